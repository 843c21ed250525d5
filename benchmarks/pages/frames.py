"""The time between two frames of the page while it learns.

    python -m benchmarks.pages.frames [FRAMES]

Trains in the page as fast as it can, one network and a healthy beside a faulty one, and takes the
times of 900 frames of each. 16.7 ms are 60 frames per second. It needs Chromium and its
chromedriver, and takes two minutes on a machine without other work.
"""

from __future__ import annotations

import sys

import numpy as np

from benchmarks.pages.headless_page import open_page, wait_for
from benchmarks.result_files import write

PAGES = ("reference", "swingup", "cartpole")
RUNS = {"one": "", "healthy and faulty": "fault=no-bootstrapping&"}
_FIRST = 5  # frames that are not counted
_TIMES = """
const [count, done] = arguments;
const times = [];
let last = performance.now();
const frame = (now) => {
  times.push(now - last);
  last = now;
  if (times.length < count) requestAnimationFrame(frame);
  else done(times);
};
requestAnimationFrame(frame);
"""


def main(frames: int = 900) -> None:
    """Measures the frames and writes the table."""
    rows = []
    for name in PAGES:
        for runs, words in RUNS.items():
            with open_page(name) as browser:
                browser.execute_script(f"location.hash = '{words}seed=3'")
                wait_for(browser, "pendulum.lesson?.exact")
                browser.execute_script("pendulum.lesson.choose({speed: 0})")
                browser.execute_script("pendulum.lesson.run(true)")
                times = browser.execute_async_script(_TIMES, frames + _FIRST)[_FIRST:]
            middle, most, longest = np.percentile(times, [50, 95, 100])
            rows.append(
                {
                    "page": name,
                    "networks that learn": runs,
                    "frame, ms: median": round(middle, 1),
                    "95 % take at most": round(most, 1),
                    "longest": round(longest, 1),
                }
            )
    write("frames", "python -m benchmarks.pages.frames", rows)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
