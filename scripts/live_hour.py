#!/usr/bin/env python3
"""Tracks a looped video live for an hour and shows each pose in `doppel view`, and measures memory and delays.

    scripts/live_hour.py CAPTURE VIDEO OUT [--minutes 60] [--stops] [--camera 0] [--sequence testing]

VIDEO is of that camera and sequence; it is played again and again at its own rate. A client asks the viewer for the
poses as its page does. With --stops, both programs are stopped for three seconds each in the last two minutes, as a
busy machine stops them. Prints JSON: images, latency, gaps between the poses that the client gets, and the largest
memory in each tenth of the time. Exits 1 if a program ends early or fails, or if the memory of one grows by more than 2
MB after the first minute.
"""
import argparse
import json
import os
import signal
import struct
import subprocess
import sys
import threading
import time
import urllib.request
from pathlib import Path

DOPPEL = os.environ.get("DOPPEL", str(Path(__file__).resolve().parent.parent / "build/release/tools/doppel"))
SETTLED, BOUND_MB = 60.0, 2.0


def private_mb(process):
    """Memory of the process alone, in MB: RssAnon, without the pages of files."""
    with open(f"/proc/{process.pid}/status") as status:
        return next(int(line.split()[1]) for line in status if line.startswith("RssAnon")) / 1024


class Client(threading.Thread):
    """Asks for the newest pose again and again, and notes when each comes."""

    def __init__(self, url):
        super().__init__(daemon=True)
        self.base, self.token = url.split("?token=")
        self.arrivals = []

    def run(self):
        after = 0
        while True:
            request = f"{self.base}api/live?after={after}&stage=skinning&token={self.token}"
            try:
                with urllib.request.urlopen(request, timeout=60) as answer:
                    body = answer.read()
            except OSError:  # the viewer has ended
                return
            if body:
                after = struct.unpack_from("<I", body)[0]
                self.arrivals.append(time.monotonic())


def stopped_for(process, seconds):
    process.send_signal(signal.SIGSTOP)
    time.sleep(seconds)
    process.send_signal(signal.SIGCONT)


def watch(processes, minutes, start, stops):
    """Memory of each process, [(seconds, MB)], until the time is over. Stops the process stops[second]."""
    memory = {name: [] for name in processes}
    while (now := time.monotonic() - start) < 60.0 * minutes:
        for name, process in processes.items():
            if process.poll() is not None:
                sys.exit(f"live_hour.py: doppel {name} ended after {now:.0f} s with code {process.returncode}")
            memory[name].append((now, private_mb(process)))
        for at in [at for at in stops if at <= now]:
            stopped_for(processes[stops.pop(at)], 3.0)
        time.sleep(1.0)
    return memory


def summary(memory, minutes):
    """Largest memory in each tenth, and the growth after the first minute."""
    tenth = 6.0 * minutes
    largest = [max((mb for t, mb in memory if int(t / tenth) == i), default=0.0) for i in range(10)]
    settled = max(mb for t, mb in memory if t < 2 * SETTLED)
    grown = max((mb for t, mb in memory if t >= SETTLED), default=settled) - settled
    return {"MB": [round(mb, 1) for mb in largest], "grown_MB": round(grown, 2)}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("capture")
    parser.add_argument("video")
    parser.add_argument("out", type=Path)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--stops", action="store_true")
    parser.add_argument("--camera", default="0")
    parser.add_argument("--sequence", default="testing")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)

    view = subprocess.Popen([DOPPEL, "view", options.capture, "--no-open", "--json", "--threads", "1"],
                            stdout=subprocess.PIPE, stderr=open(options.out / "view.log", "w"), text=True)
    url = json.loads(view.stdout.readline())["url"]
    client = Client(url)
    track = subprocess.Popen([DOPPEL, "track", "live", options.capture, "--camera", options.camera, "--sequence",
                              options.sequence, "--source", options.video, "--real-time", "--repeat", "1000000",
                              "--send", url, "--out", options.out],
                             stdout=subprocess.DEVNULL, stderr=open(options.out / "track.log", "w"))
    start = time.monotonic()
    client.start()
    end = 60.0 * options.minutes
    stops = {end - 100: "track", end - 50: "view"} if options.stops else {}
    memory = watch({"track": track, "view": view}, options.minutes, start, stops)
    for process in (track, view):
        process.send_signal(signal.SIGINT)
    codes = [process.wait(timeout=600) for process in (track, view)]

    live = json.loads((options.out / "track.json").read_text())["sequences"]["live"]["live"]
    undisturbed = [t for t in client.arrivals if SETTLED < t - start < min(stops, default=end)]
    gaps = sorted(1e3 * (b - a) for a, b in zip(undisturbed, undisturbed[1:]))
    report = {
        "minutes": options.minutes, "exit_codes": codes, "pictures": live["pictures"], "dropped": live["dropped"],
        "latency_ms": live["latency_ms"],
        "gaps_ms": {"median": gaps[len(gaps) // 2], "99.9 %": gaps[len(gaps) * 999 // 1000], "largest": gaps[-1]},
        "poses_shown": len(client.arrivals),
        "track": summary(memory["track"], options.minutes), "view": summary(memory["view"], options.minutes)}
    print(json.dumps(report, indent=1))
    flat = all(report[name]["grown_MB"] <= BOUND_MB for name in ("track", "view"))
    sys.exit(0 if codes == [0, 0] and flat else 1)


main()
