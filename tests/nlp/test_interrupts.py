"""Ctrl-C is answered once, whatever swallows exceptions meanwhile."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from nlp import interrupts

ROOT = Path(__file__).parents[2]
SWALLOWS = """
import signal
try:
    signal.raise_signal(signal.SIGINT)
except BaseException:
    pass
"""
BEGIN = """
import signal, time
from nlp.interrupts import answer_interrupts, deferred_interrupt
from nlp.interrupts import interrupt_answered, settle_interrupts
signal.signal(signal.SIGINT, signal.default_int_handler)
answer_interrupts()
seen = []
try:
"""
END = """
except KeyboardInterrupt:
    seen.append("answered")
print(*seen)
"""
CASES = {
    "import": ("import swallows; time.sleep(5)", "answered"),
    "import at the very end": ("import swallows; settle_interrupts()", "answered"),
    "conversion by CasADi": (
        "import casadi as ca\n"
        "class Odd:\n"
        "    def __SX__(self): signal.raise_signal(signal.SIGINT); return ca.SX(1)\n"
        "seen.append(str(ca.sin(Odd()).is_constant()))\n"
        "time.sleep(5)",
        "True answered",
    ),
    "short start": (
        "with deferred_interrupt(limited=True):\n"
        "    signal.raise_signal(signal.SIGINT); seen.append('ended')",
        "ended answered",
    ),
    "long start": (
        "with deferred_interrupt(limited=True):\n"
        "    signal.raise_signal(signal.SIGINT); time.sleep(5); seen.append('ended')",
        "answered",
    ),
    "long start that swallows": (
        "with deferred_interrupt(limited=True):\n"
        "    signal.raise_signal(signal.SIGINT)\n"
        "    try: time.sleep(5)\n"
        "    except KeyboardInterrupt: seen.append('swallowed')",
        "swallowed answered",
    ),
    "conic solver": (
        "import hashlib, threading, types, nlp.conic\n"
        "slow = lambda **_: hashlib.pbkdf2_hmac('md5', b'', b'', 10**7) and seen.append(0)\n"
        "threading.Timer(0.1, signal.raise_signal, (signal.SIGINT,)).start()\n"
        "nlp.conic.run(types.SimpleNamespace(solve=slow), 'CLARABEL')",
        "answered",
    ),
    "destructor": (
        "class Odd:\n"
        "    def __del__(self): signal.raise_signal(signal.SIGINT)\n"
        "Odd()\n"
        "time.sleep(5)",
        "answered",
    ),
    "library that swallows": (
        "try: signal.raise_signal(signal.SIGINT)\n"
        "except KeyboardInterrupt: seen.append('swallowed')\n"
        "time.sleep(5)",
        "swallowed answered",
    ),
    "answered, and work goes on": (
        "try: signal.raise_signal(signal.SIGINT)\n"
        "except KeyboardInterrupt: interrupt_answered()\n"
        "time.sleep(1.5); seen.append('ended')",
        "ended",
    ),
    "long clean-up": (
        "try: signal.raise_signal(signal.SIGINT)\n"
        "finally: time.sleep(1.5); seen.append('ended')",
        "ended answered",
    ),
    "writing": (
        "with deferred_interrupt():\n"
        "    signal.raise_signal(signal.SIGINT); time.sleep(1); seen.append('ended')",
        "ended answered",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_an_interrupt_is_answered_once(tmp_path, case):
    code, said = CASES[case]
    (tmp_path / "swallows.py").write_text(SWALLOWS)
    script = tmp_path / "script.py"
    path = f"import sys; sys.path.insert(0, {str(ROOT)!r})"
    body = "".join(f"    {line}\n" for line in code.splitlines())
    script.write_text(path + BEGIN + body + END)
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False)
    assert (done.stdout.strip(), done.stderr) == (said, "")


def test_after_the_work_it_ends_the_process_in_the_same_words():
    """Python would show a traceback of an exception that is raised while it ends."""
    path = f"import sys; sys.path.insert(0, {str(ROOT)!r})"
    ending = "import atexit; atexit.register(signal.raise_signal, signal.SIGINT)\n"
    script = path + BEGIN + "    pass\nfinally: settle_interrupts()\nprint('output')\n" + ending
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "output\n", "Interrupted.\n")


def test_a_late_alarm_does_not_hide_what_is_written_afterwards(monkeypatch):
    """Once the block has ended, the handler is the one from before."""
    monkeypatch.setattr(interrupts, "_alarm", lambda _: signal.raise_signal(signal.SIGINT))
    before, stderr = signal.getsignal(signal.SIGINT), sys.stderr
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt), interrupts.deferred_interrupt():
            signal.raise_signal(signal.SIGINT)
        assert sys.stderr is stderr
    finally:
        signal.signal(signal.SIGINT, before)
