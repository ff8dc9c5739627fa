"""`make live-demo`: a test plant, a link and its page on this machine with one command, until Ctrl-C.

The plant has an effect that the link's model lacks. Discovery finds it after some ten minutes; a person then decides.
It plays twice as fast as real time: a decision that has to give up a limit takes up to half a second.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from adaptive_flot.files import write_text
from adaptive_flot.live.certificates import make_certificates, token_file
from adaptive_flot.live.link_file import load_link
from adaptive_flot.live.plant.link_text import link_text
from adaptive_flot.live.plant.server import ServerPlace
from adaptive_flot.live.program import live
from adaptive_flot.plugins import DEFAULT_ESTIMATOR
from adaptive_flot.runner.scenario.loading import load_scenario

SCENARIO, SPEED, HOURS = "undeclared_effect", 2.0, 24.0
CASE = ("economic_mpc", f"{DEFAULT_ESTIMATOR}_discovery")
SHADOWS = {"fixed": {"estimator": "fixed", "controller": "economic_mpc"}}
FOLDER = Path("results/live_demo")


def main(folder: Path = FOLDER, port: int = 4840, page: int = 8050, cycles: int | None = None) -> None:
    """Start the plant in a process of its own, and run the link and its page in this one.

    Parameters
    ----------
    folder
        For certificates, tokens, link file and database.
    port
        Where the plant listens, on this machine only.
    page
        Where the page is served, on this machine only; 0 for any free port.
    cycles
        Cycles of the link; default until Ctrl-C.
    """
    certificates, link = folder.absolute() / "certificates", folder / "link.yaml"
    if not token_file(certificates, "act").is_file():
        make_certificates(certificates)
    url = ServerPlace(certificates, port=port).url
    scenario = load_scenario(SCENARIO)
    write_text(link, link_text(scenario, url, certificates, speed=SPEED, page=page, case=CASE, shadows=SHADOWS))
    command = [sys.executable, "-m", "adaptive_flot", "serve-plant", SCENARIO, "--auto-operator"]
    options = {"--certificates": certificates, "--speed": SPEED, "--hours": HOURS, "--port": port}
    arguments = [str(part) for pair in options.items() for part in pair]
    plant = subprocess.Popen([*command, *arguments], start_new_session=True)  # Ctrl-C reaches the link alone
    try:
        print(f"Memory: {folder / 'live.sqlite'}; read it with `adaptive-flot export {link} --out record.csv`")
        print(f"Token for acting: {token_file(certificates, 'act').read_text().strip()}")
        print(f"Token for viewing: {token_file(certificates, 'view').read_text().strip()}", flush=True)
        live(load_link(link), lambda words: print(words, flush=True), cycles)
    finally:
        plant.terminate()
        plant.wait()


if __name__ == "__main__":
    main()
