"""Run a program and write the peak of its memory: rank_memory.py FOLDER PROGRAM [ARGUMENT...].

Stands between mpirun and the program, once a rank; writes FOLDER/<process>.json. Imports next to
nothing: the peak of a program is not below that of the program that starts it.
"""

import os
import sys


def main(folder, command):
    """Run the command; its exit code."""
    child = os.posix_spawnp(command[0], command, os.environ)
    _, status, usage = os.wait4(child, 0)
    report = os.open(f"{folder}/{os.getpid()}.json", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.write(report, b'{"peak_kib": %d}\n' % usage.ru_maxrss)
    os.close(report)
    return os.waitstatus_to_exitcode(status)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))
