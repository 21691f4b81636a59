"""Ctrl-C is answered once, whatever swallows exceptions meanwhile."""

import subprocess
import sys
from pathlib import Path

import pytest

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
from nlp.interrupts import answer_interrupts, deferred_interrupt, settle_interrupts
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
