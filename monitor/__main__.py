"""``python -m monitor``: the page as a process."""

from monitor.process import main
from runtime.process.lifeline import run_process

if __name__ == "__main__":
    run_process(main)
