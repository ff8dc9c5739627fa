"""`make live-demo`: a test plant, a link and its page on this machine, until Ctrl-C."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from adaptive_flot.live.certificates import make_certificates
from adaptive_flot.live.link_file import load_link
from adaptive_flot.live.program import live

SCENARIO, SPEED, HOURS = "closed_loop_drift", 5.0, 24.0
FOLDER = Path("results/live_demo")


def main(folder: Path = FOLDER, port: int = 4840, cycles: int | None = None) -> None:
    """Start the plant in a process of its own, and run the link in this one.

    Parameters
    ----------
    folder
        For certificates, link file and database.
    port
        Where the plant listens, on this machine only.
    cycles
        Cycles of the link; default until Ctrl-C.
    """
    certificates, link = folder / "certificates", folder / "link.yaml"
    if not certificates.is_dir():
        make_certificates(certificates)
    command = [sys.executable, "-m", "adaptive_flot", "serve-plant", SCENARIO, "--auto-operator"]
    options = {"--certificates": certificates, "--speed": SPEED, "--hours": HOURS, "--port": port, "--write-link": link}
    link.unlink(missing_ok=True)
    plant = subprocess.Popen([*command, *(str(part) for pair in options.items() for part in pair)])
    try:
        while not link.is_file() and plant.poll() is None:
            try:
                plant.wait(0.1)
            except subprocess.TimeoutExpired:
                continue
        if plant.poll() is None:
            print(f"Memory: {folder / 'live.sqlite'}; read it with `adaptive-flot export {link} --out record.csv`")
            live(load_link(link), print, cycles)
    finally:
        plant.terminate()
        plant.wait()


if __name__ == "__main__":
    main()
