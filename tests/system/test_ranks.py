"""The same bits from any number of ranks, on one host and on two.

And what a long run says of its ranks and of its time, and how much memory it takes.
"""

import contextlib
import os
import re
import shutil
import subprocess
import sys

import h5py
import pytest
from jobs import EPOCH, EXIT_COMPLETE, Job, map_deck, needs_open_mpi

ADDRESSES = ("10.231.77.1", "10.231.77.2")
AGENT = """#!/bin/sh
# Stands in for ssh: runs the command on the "host" with this address, a network namespace that
# has a host name of its own.
host=$1
shift
exec ip netns exec "spf$host" unshare --uts sh -c "hostname node-$host && $*"
"""


@pytest.fixture(scope="module")
def whole(root, program, tmp_path_factory, mpiexec):
    """The file of a run on one rank."""
    folder = tmp_path_factory.mktemp("whole")
    deck = map_deck(root, folder, rows=3, speeds=200)
    with Job(program, mpiexec, deck, ranks=1, folder=folder) as job:
        assert job.wait() == EXIT_COMPLETE, job.output
    return folder / "map.h5"


@pytest.mark.parametrize("ranks", [8, 16])
def test_more_ranks_than_cores(root, run, whole, tmp_path, ranks):
    deck = map_deck(root, tmp_path, rows=3, speeds=200)
    done = run(deck, ranks=ranks, environment=EPOCH)
    assert done.returncode == EXIT_COMPLETE, done.stderr
    assert (tmp_path / "map.h5").read_bytes() == whole.read_bytes()


@pytest.mark.parametrize("start", ["static", "up"])
def test_more_ranks_than_points(root, run, tmp_path, start):
    contents = set()
    for ranks in (1, 7):
        folder = tmp_path / str(ranks)
        deck = map_deck(root, folder, rows=2, speeds=2, start=start)
        done = run(deck, ranks=ranks, folder=folder, environment=EPOCH)
        assert done.returncode == EXIT_COMPLETE, done.stderr
        contents.add((folder / "map.h5").read_bytes())
    assert len(contents) == 1


def test_load_of_each_rank(root, run, tmp_path):
    """The points of the ranks add up, and they are busy no longer than the run."""
    deck = map_deck(root, tmp_path, rows=4, speeds=200)
    done = run(deck, ranks=3, environment=EPOCH)
    assert done.returncode == EXIT_COMPLETE, done.stderr
    loads = re.findall(r"rank (\d): (\d+) points, busy ([\d.]+) s", done.stdout)
    assert [int(rank) for rank, _, _ in loads] == [0, 1, 2]
    assert sum(int(points) for _, points, _ in loads) == 5 * 200
    elapsed = float(re.search(r"done in ([\d.]+) s", done.stdout)[1])
    assert 0.0 < max(float(busy) for _, _, busy in loads) <= elapsed + 0.01
    efficiency = float(re.search(r"efficiency ([\d.]+) %", done.stdout)[1])
    assert 0.0 < efficiency <= 100.1


def test_error_of_the_estimated_time(root, run, tmp_path):
    """A phase of more than a second says how wrong its estimate was."""
    deck = map_deck(root, tmp_path, rows=8)
    done = run(deck, environment=EPOCH)
    assert done.returncode == EXIT_COMPLETE, done.stderr
    said = re.findall(
        r"at half of the points: ([\d.]+) s; it took ([\d.]+) s \(error (-?\d+) %\)", done.stdout
    )
    assert said, done.stdout
    estimated, taken, error = (float(word) for word in said[-1])
    assert 100.0 * (estimated - taken) / taken == pytest.approx(
        error, abs=1.0 + 100.0 * 0.1 * (1 + estimated / taken) / taken
    )


CHEAP = {
    r"support\s*=\s*'both'": "support = 'flexible'",
    r"speed_first\s*=.*": "speed_first = 3000.0",
    r"stiffness_first\s*=.*": "stiffness_first = 1.0e9",
    r"error_amplitudes\s*=.*": "error_amplitudes = 1.0e-8",
    r"stiffness_coefficients\s*=.*": "stiffness_coefficients = 0.02",
    r"tolerance\s*=.*": "tolerance = 1.0e-2",
    r"products\s*=.*": "products = 'map'",
}
"""Changes of the deck that make its points cheap: the teeth never part, and one monodromy is enough."""


def peak_memory(root, program, mpiexec, folder, **grid):
    """Largest peak of the memory of two ranks, and bytes of the variables of the file."""
    deck = map_deck(root, folder, **grid)
    text = deck.read_text()
    for pattern, new in CHEAP.items():
        text, found = re.subn(pattern, new, text)
        assert found == 1, pattern
    deck.write_text(text)
    report = folder / "peak"
    report.mkdir()
    helper = root / "tests" / "benchmark" / "rank_memory.py"
    command = [*mpiexec, "2", sys.executable, str(helper), str(report), str(program), str(deck)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=900, check=False)
    assert done.returncode == EXIT_COMPLETE, done.stdout + done.stderr
    peaks = [int(re.search(r"\d+", path.read_text())[0]) * 1024 for path in report.iterdir()]
    assert len(peaks) == 2
    with h5py.File(folder / "map.h5", "r") as file:
        size = sum(v.size * v.dtype.itemsize for v in file.values() if isinstance(v, h5py.Dataset))
    (folder / "map.h5").unlink()
    return max(peaks), size


@pytest.mark.slow
def test_memory_is_flat_over_a_million_points(root, program, mpiexec, tmp_path):
    """A rank keeps of each point its state and its place in the plan, but none of its numbers.

    It grows by less than the file does, and by less than 64 bytes a point.
    """
    rows = (10, 1000)
    peaks, files = zip(
        *(peak_memory(root, program, mpiexec, tmp_path / str(r), rows=r, speeds=1000) for r in rows),
        strict=True,
    )
    points = 1000 * (rows[1] - rows[0])
    growth = (peaks[1] - peaks[0]) / points
    print(f"{growth:.1f} bytes a point in memory, {(files[1] - files[0]) / points:.1f} in the file")
    assert growth < 64.0
    assert peaks[1] - peaks[0] < files[1] - files[0]


@contextlib.contextmanager
def two_hosts():
    """Two network namespaces with a cable between them; skips where that is not allowed."""
    if shutil.which("ip") is None or shutil.which("unshare") is None:
        pytest.skip("no ip or no unshare")
    names = [f"spf{address}" for address in ADDRESSES]

    def ip(*words, check=True):
        return subprocess.run(["ip", *words], capture_output=True, text=True, check=check)

    def clean():
        for name in names:
            ip("netns", "del", name, check=False)

    clean()
    try:
        for name in names:
            ip("netns", "add", name)
        ip(
            "link",
            "add",
            "spf0",
            "netns",
            names[0],
            "type",
            "veth",
            "peer",
            "name",
            "spf1",
            "netns",
            names[1],
        )
        for name, address, cable in zip(names, ADDRESSES, ("spf0", "spf1"), strict=True):
            ip("-n", name, "addr", "add", f"{address}/24", "dev", cable)
            ip("-n", name, "link", "set", cable, "up")
            ip("-n", name, "link", "set", "lo", "up")
        trial = ["ip", "netns", "exec", names[0], "unshare", "--uts", "hostname", "trial"]
        subprocess.run(trial, check=True, capture_output=True, text=True)
    except subprocess.CalledProcessError as error:
        clean()
        pytest.skip(f"network namespaces are not allowed here: {error.stderr.strip()}")
    try:
        yield names
    finally:
        clean()


def test_two_hosts(root, program, mpiexec, whole, tmp_path):
    """Ranks in two network namespaces, which see each other by TCP only, make the same file."""
    needs_open_mpi(mpiexec)
    agent = tmp_path / "agent"
    agent.write_text(AGENT)
    agent.chmod(0o755)
    folder = tmp_path / "run"
    deck = map_deck(root, folder, rows=3, speeds=200)
    with two_hosts() as names:
        options = {
            "plm_rsh_agent": str(agent),
            "plm_rsh_no_tree_spawn": "1",
            "oob_tcp_if_include": "10.231.77.0/24",
            "btl_tcp_if_include": "10.231.77.0/24",
            "btl": "self,tcp",
        }
        command = [
            shutil.which(mpiexec[0]),
            "--host",
            ",".join(f"{a}:1" for a in ADDRESSES),
            "-n",
            "2",
            "--tag-output",
        ]
        command += [word for key, value in options.items() for word in ("--mca", key, value)]
        words = " ".join([*command, "sh", "-c", f"'hostname; exec {program} {deck}'"])
        done = subprocess.run(
            [
                "ip",
                "netns",
                "exec",
                names[0],
                "unshare",
                "--uts",
                "sh",
                "-c",
                f"hostname node-{ADDRESSES[0]} && {words}",
            ],
            cwd=folder,
            env={**os.environ, **EPOCH},
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
    assert done.returncode == EXIT_COMPLETE, done.stdout + done.stderr
    assert {f"node-{address}" for address in ADDRESSES} <= set(re.findall(r"node-[\d.]+", done.stdout))
    assert (folder / "map.h5").read_bytes() == whole.read_bytes()
