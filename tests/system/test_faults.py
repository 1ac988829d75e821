"""Faults of disks, files, processes and clocks during a run.

What is promised of each stands in the table of tests/README.md: a message, an exit code, and that
nothing computed is lost and nothing wrong kept.
"""

import contextlib
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import h5py
import pytest
from jobs import (
    EPOCH,
    EXIT_COMPLETE,
    EXIT_DECK,
    EXIT_INTERNAL,
    EXIT_MISMATCH,
    Job,
    assert_done_points_are_right,
    done_count,
    map_deck,
    needs_open_mpi,
    same_values,
    snapshot,
)

ROWS = 5


@pytest.fixture(scope="module")
def whole(root, program, mpiexec, tmp_path_factory):
    """The file of a run that nothing disturbs."""
    folder = tmp_path_factory.mktemp("whole")
    deck = map_deck(root, folder, rows=ROWS)
    with Job(program, mpiexec, deck, ranks=2, folder=folder) as job:
        assert job.wait() == EXIT_COMPLETE, job.output
    return folder / "map.h5"


def go_on(run, deck, folder, whole, path="map.h5"):
    """Run on to the end; the file is that of the undisturbed run."""
    done = run(deck, ranks=2, folder=folder, environment=EPOCH)
    assert done.returncode == EXIT_COMPLETE, done.stderr
    assert (folder / path).read_bytes() == whole.read_bytes()


@contextlib.contextmanager
def mounted(folder, *options):
    """Mount something; skips where that is not allowed."""
    folder.mkdir(parents=True, exist_ok=True)
    done = subprocess.run(["mount", *options, str(folder)], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        pytest.skip(f"mounting is not allowed here: {done.stderr.strip()}")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=False)


def fill(folder):
    """Write to a disk until it is full."""
    with (folder / "rest").open("wb", buffering=0) as file, contextlib.suppress(OSError):
        while True:
            file.write(bytes(4096))


# Disks and folders ---------------------------------------------------------------------------


def test_disk_full_at_the_start(root, run, tmp_path):
    with mounted(tmp_path / "disk", "-t", "tmpfs", "-o", "size=128k", "tmpfs") as disk:
        done = run(map_deck(root, tmp_path, file="disk/map.h5"), ranks=2)
        assert done.returncode == EXIT_INTERNAL
        assert "cannot make the result file 'disk/map.h5'" in done.stderr
        assert "No space left on device" in done.stderr
        assert not (disk / "map.h5").exists()
        assert [path.name for path in disk.iterdir()] == []


def test_fresh_on_a_full_disk_keeps_the_old_file(root, run, tmp_path):
    with mounted(tmp_path / "disk", "-t", "tmpfs", "-o", "size=1m", "tmpfs") as disk:
        deck = map_deck(root, tmp_path, file="disk/map.h5", rows=3, speeds=20)
        assert run(deck).returncode == EXIT_COMPLETE
        before = (disk / "map.h5").read_bytes()
        fill(disk)
        done = run("--fresh", deck)
        assert done.returncode == EXIT_INTERNAL
        assert "No space left on device" in done.stderr
        assert (disk / "map.h5").read_bytes() == before


def test_disk_full_when_gone_on(root, run, tmp_path):
    """Not even the lock can be written: it is said, and nothing is left behind."""
    with mounted(tmp_path / "disk", "-t", "tmpfs", "-o", "size=1m", "tmpfs") as disk:
        deck = map_deck(root, tmp_path, file="disk/map.h5", rows=3, speeds=20)
        assert run(deck).returncode == EXIT_COMPLETE
        before = (disk / "map.h5").read_bytes()
        fill(disk)
        done = run(deck, ranks=2)
        assert done.returncode == EXIT_INTERNAL
        assert "cannot write the lock file 'disk/map.h5.lock': No space left on device" in done.stderr
        assert {path.name for path in disk.iterdir()} == {"map.h5", "rest"}
        assert (disk / "map.h5").read_bytes() == before


def test_disk_full_during_the_run(root, run, program, mpiexec, whole, tmp_path):
    """The file took its room when it was made: the run ends as if nothing had happened."""
    with mounted(tmp_path / "run" / "disk", "-t", "tmpfs", "-o", "size=4m", "tmpfs") as disk:
        folder = tmp_path / "run"
        deck = map_deck(root, folder, file="disk/map.h5", rows=ROWS)
        with Job(program, mpiexec, deck, ranks=2, folder=folder) as job:
            assert job.wait_for_points(disk / "map.h5", 50)
            fill(disk)
            assert job.wait() == EXIT_COMPLETE, job.output
        assert same_values(snapshot(disk / "map.h5"), snapshot(whole))


def test_quota_at_the_start(root, program, mpiexec, tmp_path):
    """No file may be larger than 16 MB, this one would be."""
    folder = tmp_path / "run"
    deck = map_deck(root, folder, rows=400)

    # The limit is for a process and its children; enough for the files of the MPI library itself.
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2**24, limits[1]))
    try:
        with Job(program, mpiexec, deck, ranks=2, folder=folder) as job:
            code = job.wait()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert code == EXIT_INTERNAL, job.output
    assert "cannot make the result file 'map.h5'" in job.output
    assert "File too large" in job.output
    assert [path.name for path in folder.iterdir()] == ["map.nml"]


def test_quota_during_the_run(root, run, program, mpiexec, whole, tmp_path):
    needs_open_mpi(mpiexec)
    folder = tmp_path / "run"
    deck = map_deck(root, folder, rows=ROWS)
    with Job(program, mpiexec, deck, ranks=2, folder=folder) as job:
        assert job.wait_for_points(folder / "map.h5", 200)
        for number in job.ranks().values():
            resource.prlimit(number, resource.RLIMIT_FSIZE, (1024, resource.RLIM_INFINITY))
        code = job.wait()
    assert code == EXIT_INTERNAL, job.output
    assert "HDF5 cannot write the results" in job.output
    values = snapshot(folder / "map.h5")
    assert done_count(folder / "map.h5") >= 200
    assert_done_points_are_right(values, snapshot(whole))
    go_on(run, deck, folder, whole)


def test_folder_that_is_a_file(root, run, tmp_path):
    (tmp_path / "out").write_text("precious")
    done = run(map_deck(root, tmp_path, file="out/map.h5"))
    assert done.returncode == EXIT_DECK
    assert "out/map.h5" in done.stderr
    assert "Not a directory" in done.stderr
    assert (tmp_path / "out").read_text() == "precious"


def test_folder_without_permission(root, run, tmp_path):
    """Read-only by its mount: permissions alone would not keep root away."""
    with mounted(tmp_path / "disk", "-t", "tmpfs", "-o", "ro,size=1m", "tmpfs"):
        done = run(map_deck(root, tmp_path, file="disk/map.h5"), ranks=2)
        assert done.returncode == EXIT_INTERNAL
        assert "disk/map.h5" in done.stderr
        assert "Read-only file system" in done.stderr


def test_file_without_permission(root, run, tmp_path):
    deck = map_deck(root, tmp_path, rows=2, speeds=5)
    assert run(deck).returncode == EXIT_COMPLETE
    before = (tmp_path / "map.h5").read_bytes()
    path = str(tmp_path / "map.h5")
    with mounted(tmp_path / "none", "-t", "tmpfs", "tmpfs"):
        subprocess.run(["mount", "--bind", path, path], check=True)
        try:
            subprocess.run(["mount", "-o", "remount,ro,bind", path], check=True)
            done = run(deck, ranks=2)
        finally:
            subprocess.run(["umount", path], check=True)
    assert done.returncode == EXIT_INTERNAL
    assert "cannot write to 'map.h5': Read-only file system" in done.stderr
    assert (tmp_path / "map.h5").read_bytes() == before


# The file taken away ---------------------------------------------------------------------------


def remove(folder):
    (folder / "map.h5").unlink()


def remove_folder(folder):
    shutil.rmtree(folder)


def replace(folder):
    (folder / "other").write_text("somebody else's")
    (folder / "other").rename(folder / "map.h5")


@pytest.mark.parametrize("fault", [remove, remove_folder, replace])
def test_file_is_taken_away(root, run, program, mpiexec, whole, tmp_path, fault):
    """The run notices, stops, and saves what it has."""
    folder, out = tmp_path / "run", tmp_path / "run" / "out"
    deck = map_deck(root, folder, file="out/map.h5", rows=ROWS)
    out.mkdir()
    with Job(program, mpiexec, deck, ranks=2, folder=folder) as job:
        assert job.wait_for_points(out / "map.h5", 200)
        fault(out)
        code = job.wait()
    assert code == EXIT_INTERNAL, job.output
    assert "'out/map.h5' was removed or replaced during the run" in job.output
    assert "is in 'out/map.h5.saved'" in job.output
    if fault is replace:
        assert (out / "map.h5").read_text() == "somebody else's"
    assert done_count(out / "map.h5.saved") >= 200
    (out / "map.h5.saved").rename(out / "map.h5")
    done = run(deck, ranks=2, folder=folder, environment=EPOCH)
    assert done.returncode == EXIT_COMPLETE, done.stderr
    assert same_values(snapshot(out / "map.h5"), snapshot(whole))


def test_saved_file_is_not_overwritten(root, program, mpiexec, tmp_path):
    """What an earlier run saved stays; this one adds a number."""
    folder = tmp_path / "run"
    deck = map_deck(root, folder, rows=ROWS)
    (folder / "map.h5.saved").write_text("precious")
    with Job(program, mpiexec, deck, ranks=2, folder=folder) as job:
        assert job.wait_for_points(folder / "map.h5", 100)
        (folder / "map.h5").unlink()
        assert job.wait() == EXIT_INTERNAL, job.output
    assert "is in 'map.h5.saved.2'" in job.output
    assert (folder / "map.h5.saved").read_text() == "precious"
    assert done_count(folder / "map.h5.saved.2") >= 100


# Damaged files -----------------------------------------------------------------------------------


def places_of_values(path):
    """Where the bytes of the variables on the grid are in the file: offsets and sizes."""
    with h5py.File(path, "r") as file:
        variables = [data.id for data in file.values() if isinstance(data, h5py.Dataset)]
        places = []
        for data in variables:
            if data.get_offset() is not None:
                places.append((data.get_offset(), data.get_storage_size()))
                continue
            columns = [data.get_chunk_info(i) for i in range(data.get_num_chunks())]
            places += [(column.byte_offset, column.size) for column in columns]
        return places


def complete_file(root, program, mpiexec, folder, speeds):
    """A small complete file and its deck."""
    deck = map_deck(root, folder, rows=2, speeds=speeds)
    with Job(program, mpiexec, deck, ranks=1, folder=folder) as job:
        assert job.wait() == EXIT_COMPLETE, job.output
    return deck, folder / "map.h5"


@pytest.fixture(scope="module")
def small(root, program, tmp_path_factory, mpiexec):
    """A small complete file and its deck."""
    return complete_file(root, program, mpiexec, tmp_path_factory.mktemp("small"), speeds=12)


@pytest.mark.parametrize("speeds", [12, 40])
def test_flipped_bytes_of_metadata(root, program, mpiexec, tmp_path, speeds):
    """Refused with a message, or without any harm; never a crash or a hang. With and without columns."""
    deck, good = complete_file(root, program, mpiexec, tmp_path / "good", speeds)
    content = good.read_bytes()
    values = [range(offset, offset + size) for offset, size in places_of_values(good)]
    metadata = [place for place in range(len(content)) if not any(place in block for block in values)]
    generator = random.Random(7)
    harmless = 0
    for _ in range(8):
        bad = bytearray(content)
        bad[generator.choice(metadata)] ^= generator.randrange(1, 256)
        (tmp_path / "map.h5").write_bytes(bad)
        done = subprocess.run(
            [str(program), str(deck)],
            cwd=tmp_path,
            env={**os.environ, **EPOCH},
            capture_output=True,
            timeout=60,
            check=False,
        )
        message = done.stderr.decode(errors="replace")
        assert done.returncode in (EXIT_COMPLETE, EXIT_INTERNAL, EXIT_MISMATCH), message
        assert (tmp_path / "map.h5").read_bytes() == bytes(bad)
        if done.returncode == EXIT_COMPLETE:
            harmless += 1
        else:
            assert message.strip()
    assert harmless < 8


@pytest.mark.parametrize("axis", ["speed", "support_stiffness"])
def test_damaged_axis_is_refused(run, small, tmp_path, axis):
    deck, good = small
    shutil.copy(good, tmp_path)
    with h5py.File(tmp_path / "map.h5", "r+") as file:
        file[axis][1] *= 1.0 + 1e-9
    before = (tmp_path / "map.h5").read_bytes()
    done = run(deck, ranks=2)
    assert done.returncode == EXIT_MISMATCH
    assert f"the axis '{axis}' does not hold the values of the deck" in done.stderr
    assert (tmp_path / "map.h5").read_bytes() == before


def test_foreign_file_is_left_alone(root, run, tmp_path):
    deck = map_deck(root, tmp_path, rows=2, speeds=5)
    (tmp_path / "map.h5").write_text("precious")
    done = run(deck, ranks=2)
    assert done.returncode == EXIT_MISMATCH
    assert "not an HDF5 file" in done.stderr
    assert (tmp_path / "map.h5").read_text() == "precious"


def test_foreign_lock_is_left_alone(root, run, tmp_path):
    deck = map_deck(root, tmp_path, rows=2, speeds=5)
    (tmp_path / "map.h5.lock").write_text("precious\n")
    done = run(deck)
    assert done.returncode == EXIT_MISMATCH
    assert "'map.h5.lock' is needed for the lock" in done.stderr
    assert (tmp_path / "map.h5.lock").read_text() == "precious\n"
    assert not (tmp_path / "map.h5").exists()


def test_foreign_file_at_the_name_of_the_new_one_is_left_alone(root, run, tmp_path):
    deck = map_deck(root, tmp_path, rows=2, speeds=5)
    part = tmp_path / "map.h5.part"
    part.write_text("precious")
    done = run(deck, ranks=2)
    assert done.returncode == EXIT_MISMATCH
    assert "'map.h5.part' is needed to make the result file" in done.stderr
    assert part.read_text() == "precious"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map.h5.part", "map.nml"]
    # What a killed run may leave there is replaced: nothing, zeros, or how a file of HDF5 begins.
    for begin in (b"", bytes(4096), b"\x89HDF\r\n"):
        (tmp_path / "map.h5").unlink(missing_ok=True)
        part.write_bytes(begin)
        done = run(deck)
        assert done.returncode == EXIT_COMPLETE, done.stderr
        assert not part.exists()


def test_links_are_followed_but_not_replaced(root, run, tmp_path):
    deck = map_deck(root, tmp_path, rows=2, speeds=5, file="link.h5")
    (tmp_path / "link.h5").symlink_to("disk/map.h5")
    (tmp_path / "disk").mkdir()
    done = run(deck, ranks=2)
    assert done.returncode == EXIT_MISMATCH
    assert "'link.h5' is a link" in done.stderr
    (tmp_path / "link.h5").unlink()
    assert run(deck).returncode == EXIT_COMPLETE
    (tmp_path / "link.h5").rename(tmp_path / "disk" / "map.h5")
    (tmp_path / "link.h5").symlink_to("disk/map.h5")
    before = (tmp_path / "disk" / "map.h5").read_bytes()
    done = run(deck, ranks=2)
    assert done.returncode == EXIT_COMPLETE, done.stderr
    assert "nothing to do" in done.stdout
    assert run("--fresh", deck, ranks=2).returncode == EXIT_MISMATCH
    assert (tmp_path / "link.h5").is_symlink()
    assert (tmp_path / "disk" / "map.h5").read_bytes() == before


def test_pipe_in_place_of_the_result_file(root, run, tmp_path):
    """Nobody waits for what never comes."""
    deck = map_deck(root, tmp_path, rows=2, speeds=5)
    os.mkfifo(tmp_path / "map.h5")
    done = run(deck, ranks=2, timeout=60)
    assert done.returncode == EXIT_INTERNAL
    assert "cannot write to 'map.h5': Illegal seek" in done.stderr


# Processes -----------------------------------------------------------------------------------


ELSEWHERE = 'if [ "$OMPI_COMM_WORLD_RANK" = {rank} ]; then cd other; fi; exec "$@"'


def run_with_a_rank_elsewhere(program, mpiexec, folder, rank, *words, ranks=3):
    """Run with one rank in the folder `other`, as if it were on a machine with a disk of its own."""
    command = [*mpiexec, str(ranks), "sh", "-c", ELSEWHERE.format(rank=rank), "sh", str(program)]
    return subprocess.run(
        [*command, *map(str, words)],
        cwd=folder,
        env={**os.environ, **EPOCH},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


@pytest.mark.parametrize(("ranks", "rank"), [(2, 1), (5, 1), (5, 4)])
def test_rank_without_the_folder(root, run, program, mpiexec, tmp_path, ranks, rank):
    """It is told, nobody waits for ever, and a file that should be replaced is still there."""
    needs_open_mpi(mpiexec)
    deck = map_deck(root, tmp_path, rows=2, speeds=5)
    (tmp_path / "other").mkdir()
    done = run_with_a_rank_elsewhere(program, mpiexec, tmp_path, rank, deck, ranks=ranks)
    assert done.returncode == EXIT_INTERNAL, done.stdout + done.stderr
    assert f"No such file or directory on rank {rank}" in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map.nml", "other"]
    assert run(deck, environment=EPOCH).returncode == EXIT_COMPLETE
    before = (tmp_path / "map.h5").read_bytes()
    for options in ([], ["--fresh"]):
        done = run_with_a_rank_elsewhere(program, mpiexec, tmp_path, rank, *options, deck, ranks=ranks)
        assert done.returncode == EXIT_INTERNAL, done.stdout + done.stderr
        assert (tmp_path / "map.h5").read_bytes() == before
        assert sorted(path.name for path in tmp_path.iterdir()) == ["map.h5", "map.nml", "other"]


def test_rank_with_a_file_of_its_own(program, mpiexec, small, tmp_path):
    """The same deck, the same name, but another file: what it computed would be missing from the first."""
    needs_open_mpi(mpiexec)
    deck, good = small
    (tmp_path / "other").mkdir()
    shutil.copy(good, tmp_path / "other")
    shutil.copy(good, tmp_path)
    with h5py.File(tmp_path / "map.h5", "r+") as file:
        file["status"][0, :4] = 0
    before = (tmp_path / "map.h5").read_bytes()
    done = run_with_a_rank_elsewhere(program, mpiexec, tmp_path, 2, deck)
    assert done.returncode == EXIT_INTERNAL, done.stdout + done.stderr
    assert "not all ranks see the same result file 'map.h5'" in done.stderr
    assert (tmp_path / "map.h5").read_bytes() == before
    assert (tmp_path / "other" / "map.h5").read_bytes() == good.read_bytes()
    assert not (tmp_path / "map.h5.lock").exists()


def test_two_runs_on_one_file(root, run, program, mpiexec, whole, tmp_path):
    folder = tmp_path / "run"
    deck = map_deck(root, folder, rows=ROWS)
    with Job(program, mpiexec, deck, ranks=2, folder=folder) as job:
        assert job.wait_for_points(folder / "map.h5", 1)
        # However slow the machine is, the first run is still there.
        job.signal(signal.SIGSTOP)
        for options in ([], ["--fresh"]):
            done = run(*options, deck, ranks=2, folder=folder)
            assert done.returncode == EXIT_MISMATCH
            assert "another run (process" in done.stderr
        job.signal(signal.SIGCONT)
        assert job.wait() == EXIT_COMPLETE, job.output
    assert (folder / "map.h5").read_bytes() == whole.read_bytes()


def test_rank_dies(root, run, program, mpiexec, whole, tmp_path):
    """The others end with it, at once; the code is the MPI library's."""
    needs_open_mpi(mpiexec)
    folder = tmp_path / "run"
    deck = map_deck(root, folder, rows=ROWS)
    with Job(program, mpiexec, deck, ranks=3, folder=folder) as job:
        assert job.wait_for_points(folder / "map.h5", 100)
        numbers = job.ranks()
        job.kill([numbers[1]])
        assert job.wait() != EXIT_COMPLETE
        job.wait_for_nobody(numbers.values())
    assert done_count(folder / "map.h5") >= 100
    assert_done_points_are_right(snapshot(folder / "map.h5"), snapshot(whole))
    go_on(run, deck, folder, whole)


def test_slow_rank(root, program, mpiexec, whole, tmp_path):
    """A rank that runs a tenth of the time gets fewer points; the others do its work."""
    needs_open_mpi(mpiexec)
    folder = tmp_path / "run"
    deck = map_deck(root, folder, rows=ROWS)
    ended = threading.Event()

    def slow_down(number):
        while not ended.is_set():
            try:
                os.kill(number, signal.SIGSTOP)
                ended.wait(0.018)
                os.kill(number, signal.SIGCONT)
            except ProcessLookupError:
                return
            ended.wait(0.002)

    with Job(program, mpiexec, deck, ranks=3, folder=folder) as job:
        assert job.wait_until(lambda: len(job.ranks()) == 3 and (folder / "map.h5.lock").exists(), "no ranks")
        worker = threading.Thread(target=slow_down, args=(job.ranks()[2],))
        worker.start()
        try:
            assert job.wait() == EXIT_COMPLETE, job.output
        finally:
            ended.set()
            worker.join()
    points = {int(rank): int(count) for rank, count in re.findall(r"rank (\d): (\d+) points", job.output)}
    assert points[2] < 0.6 * max(points[0], points[1]), job.output
    assert (folder / "map.h5").read_bytes() == whole.read_bytes()


def test_clock_jumps(root, run, tmp_path):
    """Only the monotonic clock counts: no hang, no false end by a limit, no false time."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    source = Path(__file__).with_name("clock_jump.c")
    library = tmp_path / "clock_jump.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", str(library), str(source), "-ldl"], check=True)
    date = subprocess.run(
        ["date", "+%Y"], env={**os.environ, "LD_PRELOAD": str(library)}, capture_output=True, check=True
    )
    assert date.stdout
    jumping = tmp_path / "jumping"
    steady = tmp_path / "steady"
    deck = map_deck(root, jumping, rows=3, speeds=200, limit=5.0)
    assert (
        run(deck, folder=jumping, environment={**EPOCH, "LD_PRELOAD": str(library)}).returncode
        == EXIT_COMPLETE
    )
    steady.mkdir()
    done = run(deck, folder=steady, environment=EPOCH)
    assert (jumping / "map.h5").read_bytes() == (steady / "map.h5").read_bytes()
    jumped = run("--fresh", deck, folder=jumping, environment={**EPOCH, "LD_PRELOAD": str(library)})
    seconds = [float(re.search(r"done in ([\d.]+) s", d.stdout)[1]) for d in (done, jumped)]
    assert 0.0 < seconds[1] < 60.0 + seconds[0]


# The figure step ---------------------------------------------------------------------------------

HALF_A_FIGURE = """
import os, signal, sys
from pathlib import Path
from matplotlib.figure import Figure
from spurflex_postproc import output

def half(self, path, *, format, **rest):
    Path(path).write_bytes(b"half a figure")
    if format == "png":
        os.kill(os.getpid(), signal.SIGKILL)

Figure.savefig = half
output.save(Figure(), Path(sys.argv[1]), "figure")
"""


def test_figure_step_is_killed_while_writing(root, tmp_path):
    """What has the name of a figure is a whole figure."""
    pytest.importorskip("spurflex_postproc")
    whole = HALF_A_FIGURE.replace("Figure.savefig = half\n", "")
    subprocess.run([sys.executable, "-c", whole, str(tmp_path)], check=True)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert set(before) == {"figure.pdf", "figure.png"}
    done = subprocess.run([sys.executable, "-c", HALF_A_FIGURE, str(tmp_path)], check=False)
    assert done.returncode == -signal.SIGKILL
    assert {path.name: path.read_bytes() for path in tmp_path.glob("figure.*")} == before


# No surprises ------------------------------------------------------------------------------------


def test_nothing_in_a_deck_reaches_a_shell(root, run, tmp_path):
    name = "$(touch a) `touch b`; touch c #.h5"
    deck = map_deck(root, tmp_path, rows=2, speeds=3, file=name)
    deck.write_text(deck.read_text().replace("title = '", "title = '$(touch d) `touch e` "))
    done = run(deck, ranks=2)
    assert done.returncode in (EXIT_COMPLETE, EXIT_DECK)
    names = {path.name for path in tmp_path.iterdir()}
    assert names <= {"map.nml", name}


def test_sources_start_no_program(root):
    calls = re.compile(
        r"execute_command_line|name='(system|popen|exec\w*|posix_spawn\w*|fork)'|call system\b", re.IGNORECASE
    )
    for path in (root / "src").rglob("*.f90"):
        assert not calls.search(path.read_text()), path


def test_writes_nowhere_else(root, run, tmp_path):
    """Only the result file is left, and in the folder that the deck names; the home folder stays as it is."""
    home, folder = tmp_path / "home", tmp_path / "work"
    home.mkdir()
    (folder / "out").mkdir(parents=True)
    deck = map_deck(root, folder, rows=2, speeds=3, file="out/map.h5")
    done = run(deck, folder=folder, environment={"HOME": str(home)})
    assert done.returncode == EXIT_COMPLETE, done.stderr
    assert sorted(str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file()) == [
        "work/map.nml",
        "work/out/map.h5",
    ]


def test_files_during_the_run_are_beside_the_result(root, program, mpiexec, tmp_path):
    folder = tmp_path / "run"
    (folder / "out").mkdir(parents=True)
    deck = map_deck(root, folder, rows=2, file="out/map.h5")
    seen = set()
    with Job(program, mpiexec, deck, ranks=1, folder=folder) as job:
        while job.process.poll() is None:
            seen |= {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
            time.sleep(0.01)
        assert job.wait() == EXIT_COMPLETE, job.output
    assert "out/map.h5.lock" in seen
    # Open MPI tries for a moment whether files can be locked there.
    allowed = re.compile(r"map\.nml|out/map\.h5(\.lock|\.part|\.\w{6}|\.locktest\.\d+)?")
    assert all(allowed.fullmatch(name) for name in seen), seen
