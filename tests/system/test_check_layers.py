"""The structure check finds what it is there to find."""

import pytest
from check_layers import check_tree

MODULE = """!> Text.
module {name}
   {use}
   implicit none
   private
contains
   subroutine work()
      {code}
   end subroutine work
end module {name}
"""


def write(folder, path, use="", code="", name=None):
    """Write a module that is in order but for what is asked for."""
    file = folder / path
    file.parent.mkdir(parents=True, exist_ok=True)
    default = "spurflex_" + path.removesuffix(".f90").replace("/", "_")
    file.write_text(MODULE.format(name=name or default, use=use, code=code))
    return file


@pytest.fixture
def tree(tmp_path):
    """A source tree with one module a layer."""
    for layer in ["base", "model", "io", "sweep", "external"]:
        write(tmp_path, f"{layer}/one.f90")
    (tmp_path / "main.f90").write_text("program p\nuse spurflex\nimplicit none\nstop 1\nend program p\n")
    write(tmp_path, "spurflex.f90", use="use spurflex_sweep_one, only: x", name="spurflex")
    return tmp_path


def test_good_tree(tree):
    assert check_tree(tree) == []


def test_empty_tree(tmp_path):
    assert len(check_tree(tmp_path)) == 1


@pytest.mark.parametrize(
    ("path", "use"),
    [
        ("sweep/two.f90", "use spurflex_io_one, only: x"),
        ("sweep/two.f90", "use mpi_f08, only: MPI_Comm"),
        ("io/two.f90", "use hdf5, only: hid_t"),
        ("io/two.f90", "use, intrinsic :: iso_c_binding, only: c_int"),
        ("model/two.f90", "use spurflex_external_one, only: x"),
        ("model/two.f90", "use spurflex_model_one, only: x"),
        ("external/two.f90", "use spurflex_base_one, only: x"),
    ],
)
def test_allowed_use(tree, path, use):
    write(tree, path, use=use)
    assert check_tree(tree) == []


@pytest.mark.parametrize(
    ("path", "use"),
    [
        ("base/two.f90", "use spurflex_model_one, only: x"),
        ("base/two.f90", "use spurflex_external_one, only: x"),
        ("model/two.f90", "use spurflex_io_one, only: x"),
        ("model/two.f90", "use &\n      spurflex_io_one, only: x"),
        ("model/two.f90", "USE mpi_f08, ONLY: MPI_Comm"),
        ("sweep/two.f90", "use hdf5, only: hid_t"),
        ("external/two.f90", "use spurflex_model_one, only: x"),
        ("io/two.f90", "use spurflex_sweep_one, only: x"),
        ("io/two.f90", "use spurflex, only: x"),
        ("io/two.f90", "use spurflex_io_absent, only: x"),
        ("extra/two.f90", ""),
    ],
)
def test_forbidden_use(tree, path, use):
    write(tree, path, use=use)
    assert len(check_tree(tree)) >= 1


@pytest.mark.parametrize(
    "code",
    [
        "print *, 1",
        "print '(a)', 'x'",
        "if (.true.) print *, 1",
        "write (*, *) 1",
        "write (unit=*, fmt='(a)') 'x'",
        "write (error_unit, '(a)') 'x'",
        "stop 1",
        "error stop",
        "if (.true.) stop",
        "open (newunit=u, file='x')",
    ],
)
def test_forbidden_statement(tree, code):
    write(tree, "model/two.f90", code=code)
    assert len(check_tree(tree)) == 1


@pytest.mark.parametrize("code", ["write (text, '(i0)') 1", "x = 'stop' ! print *, 1", "stop_now = .true."])
def test_allowed_statement(tree, code):
    write(tree, "model/two.f90", code=code)
    assert check_tree(tree) == []


def test_log_may_print(tree):
    write(tree, "io/log.f90", code="write (output_unit, '(a)') 'x'")
    assert check_tree(tree) == []


def test_wrong_name(tree):
    write(tree, "model/two.f90", name="spurflex_model_three")
    assert len(check_tree(tree)) == 1


@pytest.mark.parametrize("line", ["implicit none", "private"])
def test_missing_line(tree, line):
    file = tree / "model/one.f90"
    file.write_text(file.read_text().replace(f"   {line}\n", ""))
    assert len(check_tree(tree)) == 1


def test_long_module(tree):
    file = tree / "model/one.f90"
    file.write_text(file.read_text() + "! line\n" * 400)
    assert len(check_tree(tree)) == 1
