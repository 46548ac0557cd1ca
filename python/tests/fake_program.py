#!/usr/bin/python3 -ISE
"""Stands for pliant in the tests of sweeps: options, exit codes, signals, files, but no physics. -b, or -t_end, is the
wall time;
-mode gate waits for the file "go" in its folder, -mode meet for two other running programs."""

import fcntl
import glob
import json
import os
import signal
import socket
import sys
import time

KNOWN = ("a", "b", "mode", "seed", "t_end", "threads", "options_file", "start", "outline", "mesh", "shape_outline", "obstacle", "output",
         "restart")


def fail(code, message):
    print(f"pliant: error: {message}", file=sys.stderr)
    sys.exit(code)


if sys.argv[1] == "-scenarios":
    sys.exit(print("hopper"))
if sys.argv[2:] == ["-help_markdown"]:
    rules = {"a": "fixed", "mode": "fixed", "seed": "fixed", "t_end": "may change", "threads": "not kept"}
    print("## All\n\n| option | type | on restart | meaning |\n|---|---|---|---|")
    sys.exit(print("\n".join(f"| `-{name}` | yes\\|no | {rule} | |" for name, rule in rules.items())))
if sys.argv[1] != "hopper":
    fail(2, f"unknown scenario '{sys.argv[1]}', did you mean 'hopper'?; pliant -help lists them")
options = {name[1:]: value for name, value in zip(sys.argv[2::2], sys.argv[3::2])}
for name, value in options.items():
    if name not in KNOWN:
        fail(2, f"unknown option -{name}; did you mean -a?")
    if name in ("a", "b", "seed", "t_end", "threads"):
        integer = name in ("seed", "threads")
        try:
            number = int(value) if integer else float(value)
        except ValueError:
            fail(2, f"-{name} {value}: not {'an integer' if integer else 'a finite number'}")
        if name == "threads" and not 1 <= number <= 1024:
            fail(2, f"-{name} {value}: must be at least 1 and at most 1024")
        if number < 0:
            fail(2, f"-{name} {value}: must be at least 0")
folder = options.get("output") or options["restart"]
at = 0.0
lock = None
if os.path.isdir(folder):
    lock = open(f"{folder}/run.lock", "a+", encoding="utf-8")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        lock.seek(0)
        fail(6, f"{folder} is in use by {lock.read()}; wait until it has ended, stop it by kill, or choose another folder (-output)")
    lock.truncate(0)
    print(f"process {os.getpid()} on host {socket.gethostname()}", end="", file=lock, flush=True)
if "restart" in options:
    try:
        with open(f"{options['restart']}/checkpoint-a.h5", encoding="utf-8") as file:
            at = float(file.read())
    except OSError:
        fail(2, f"there is no checkpoint in {options['restart']}; restart from the folder of a run that has one")
elif os.path.exists(f"{folder}/summary.json"):
    fail(2, f"{folder} holds a run that is finished (done); choose another -output")
elif os.path.exists(f"{folder}/run.h5") and os.path.getsize(f"{folder}/run.h5") > 0:
    fail(2, f"{folder} holds 1 frames of a run without a checkpoint to resume from; choose another -output")
stop = []
signal.signal(signal.SIGUSR1, lambda *_: stop.append(1))
begun = time.monotonic()
with open(f"{folder}/attempts", "a", encoding="utf-8") as file:
    print(f"{at} {os.environ['OMP_NUM_THREADS']}", file=file)
open(f"{folder}/run.h5", "ab").close()
mode = options.get("mode", "good")


def pause():
    time.sleep(0.01)
    if time.monotonic() - begun > 200:
        fail(3, "waited too long")


if mode == "bad":
    print("pliant: warning: something else", file=sys.stderr)
    fail(3, "not finite")
if mode == "die":
    os.kill(os.getpid(), signal.SIGKILL)
if mode == "silent":
    sys.exit(0)
while mode == "meet" and len(glob.glob(f"{folder}/../*/attempts")) < 3:
    pause()
print("going on" if at else "starting", flush=True)
while at < float(options.get("t_end", options.get("b", 0))) or (mode == "gate" and not os.path.exists(f"{folder}/go")):
    pause()
    at += 0.01
    if mode != "uncooperative" and stop:
        with open(f"{folder}/checkpoint-a.h5", "w", encoding="utf-8") as file:
            file.write(str(at))
        sys.exit(75)
if "t_end" in options:
    with open(f"{folder}/checkpoint-a.h5", "w", encoding="utf-8") as file:
        file.write(str(at))
with open(f"{folder}/summary.json", "w", encoding="utf-8") as file:
    lengths = {"t_end": {"value": float(options["t_end"])}} if "t_end" in options else {}
    json.dump({"status": "done", "t": at, "parameters": lengths, "Q": {"value": 1.0, "error": 0.1, "unit": "m"},
               "begun": begun, "ended": time.monotonic()}, file)
