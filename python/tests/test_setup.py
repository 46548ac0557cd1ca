"""scripts/setup.sh and scripts/build.sh, with substitutes for apt-get and cmake that record their arguments."""

import os
import subprocess
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"


def fake(folder, name, text):
    path = folder / name
    path.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
    path.chmod(0o755)


def run(script, folder, *arguments):
    environment = {k: v for k, v in os.environ.items() if k != "CI"} | {"PATH": f"{folder}:{os.environ['PATH']}"}
    return subprocess.run([SCRIPTS / script, *arguments], capture_output=True, encoding="utf-8", env=environment)


@pytest.mark.parametrize("status", [0, 100])
def test_errors_of_apt_are_shown_but_for_those_of_manual_pages(tmp_path, status):
    fake(tmp_path, "dpkg-query", "exit 1")
    fake(tmp_path, "sudo", 'exec "$@"')
    fake(tmp_path, "apt-get", f"""case "$*" in *install*)
      echo "Selecting previously unselected package"
      echo "update-alternatives: error: no alternatives for mpi.1" >&2
      echo "E: Unable to correct problems; update-alternatives: error: none" >&2
      exit {status};; esac""")
    done = run("setup.sh", tmp_path)
    assert done.returncode == status
    assert done.stderr == "E: Unable to correct problems; update-alternatives: error: none\n"
    assert done.stdout.endswith("Installed.\n") == (status == 0) and "Selecting" not in done.stdout


def test_build_of_one_target(tmp_path):
    """With the configuration of the full build, from which a later build continues."""
    fake(tmp_path, "cmake", f'echo "$*" >> {tmp_path}/calls')
    for arguments in ((), ("pliant",)):
        assert run("build.sh", tmp_path, *arguments).returncode == 0
    whole, build, again, one = (tmp_path / "calls").read_text(encoding="utf-8").splitlines()
    assert whole == again and one == f"{build} --target pliant"


def test_the_demo_builds_what_it_runs():
    text = (SCRIPTS / "demo.sh").read_text(encoding="utf-8")
    assert '"$root/scripts/build.sh" pliant\n' in text and text.index("demo/soft.png") < text.index('"${polygons[@]}"')
    assert subprocess.run(["bash", "-n", SCRIPTS / "demo.sh"]).returncode == 0
