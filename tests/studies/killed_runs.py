"""A script: kill a run at each change that it makes to its folder, and look at what is left."""

import os
import shutil
import signal
import sys
from pathlib import Path

from test_study import Effort, Other, Part, Row, study

OLD, NEW, NEXT = 7171, 8282, 9393
CHANGES = ("os.rename", "os.remove", "os.rmdir", "os.mkdir", "shutil.rmtree")
FILES = ("numbers.csv", "others.csv", "entries.json", "x.txt", "page.md")


def result(number):
    return study(
        Part([Row(number)], entries=[{"n": number}], files={"x.txt": b"%d" % number}),
        Part([Row(number), Other(str(number))]),
        entries="entries.json",
    )


def killed(folder, point):
    """Run in a process that is killed before its change number `point`; whether it was."""
    if child := os.fork():
        return os.WIFSIGNALED(os.waitpid(child, 0)[1])
    count = 0

    def hook(event, arguments):
        nonlocal count
        if event in CHANGES and str(folder) in str(arguments[0]):
            count += 1
            if count == point:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(hook)
    result(NEW).run(folder, Effort(seed=NEW))
    os._exit(0)


def state(*folders):
    """Return which runs the files of a result are of, and whether its page says all are there.

    A file is taken from the first folder that has it.
    """
    found = [next(f / name for f in folders if (f / name).exists()) for name in FILES]
    texts = [path.read_text(encoding="utf-8") for path in found]
    of = {number for number in (OLD, NEW, NEXT) for text in texts if str(number) in text}
    return of, "Interrupted" not in texts[-1]


def main(folder):
    os.fsync = lambda _: None  # a killed process loses nothing that it wrote
    before = Path("before")
    result(OLD).run(before, Effort(seed=OLD))
    for point in range(1, 1000):
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(before, folder)
        ended = not killed(folder, point)
        made = folder / ".complete"
        of, whole = state(folder)
        if whole:
            assert of in ({OLD}, {NEW}), point
        if made.exists():
            assert state(made, folder) == ({NEW}, True), point
            of = {NEW}
        assert ended <= (of == {NEW}), point
        # The next run moves what is left over, also if it does not end itself.
        study(Part([Row(NEXT)], complete=False)).run(folder, Effort(seed=NEXT))
        assert state(folder) == (of, True), point
        assert not made.exists(), point
        if ended:
            return point - 1
    raise AssertionError("the run never ends")


if __name__ == "__main__":
    print(main(Path("out")))
