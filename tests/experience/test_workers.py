import os
import signal
import subprocess
import sys
import threading

import pytest

from lic_drake.experience.workers import ctrl_c_held_back


def test_ctrl_c_takes_effect_after_the_block() -> None:
    steps: list[str] = []
    handler = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), ctrl_c_held_back():
        os.kill(os.getpid(), signal.SIGINT)
        # A thread without the mask takes the signal at once; Python then tells the main thread.
        signal.raise_signal(signal.SIGINT)
        steps.append("the block went on")
    assert steps == ["the block went on"]
    assert signal.getsignal(signal.SIGINT) is handler
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])


def test_a_process_that_starts_in_the_block_never_sees_ctrl_c() -> None:
    script = "import os, signal; os.kill(os.getpid(), signal.SIGINT); print('untouched')"
    with ctrl_c_held_back():
        result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (result.stdout, result.stderr) == ("untouched\n", "")


def test_other_threads_may_use_it() -> None:
    steps: list[str] = []

    def use() -> None:
        with ctrl_c_held_back():
            steps.append("used")

    thread = threading.Thread(target=use)
    thread.start()
    thread.join()
    assert steps == ["used"]
