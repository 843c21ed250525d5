"use strict";

const FLICK_TIME = 0.1; // s before the release that determine the speed of a flick

/**
 * Lets a pointer move the system: a drag turns a pendulum and its last movement pushes it, and a
 * press on the phase portrait chooses θ and θ̇.
 */
class Touch {
  /** `put` is called with θ, θ̇ and whether the pointer is released. */
  constructor(put) {
    this.put = put;
    this.moves = []; // [time in s, θ without jumps] of the present drag
  }

  listenToPendulum(canvas) {
    const angle = (event) => {
      const { left, top, width, height } = canvas.getBoundingClientRect();
      return Math.atan2(left + width / 2 - event.clientX, top + height / 2 - event.clientY);
    };
    const add = (event) => {
      const before = this.moves.at(-1)?.[1] ?? angle(event);
      this.moves.push([event.timeStamp / 1000, before + wrapped(angle(event) - before)]);
    };
    this.#drag(canvas, {
      down: (event) => {
        this.moves = [];
        add(event);
        this.put(this.moves.at(-1)[1], 0, false);
      },
      move: (event) => {
        add(event);
        this.put(this.moves.at(-1)[1], 0, false);
      },
      up: (event) => this.put(this.moves.at(-1)[1], this.flickSpeed(event.timeStamp / 1000), true),
    });
  }

  listenToPortrait(canvas) {
    const state = (event) => {
      const { left: x, top: y, width, height } = canvas.getBoundingClientRect();
      const [left, right, top, bottom] = portraitEdges(width, height);
      const share = (event.clientX - x - left) / (right - left);
      const rise = (event.clientY - y - top) / (bottom - top);
      const theta = clipped((2 * share - 1) * Math.PI, Math.PI);
      return [theta, clipped((1 - 2 * rise) * MAX_SPEED, MAX_SPEED)];
    };
    this.#drag(canvas, {
      down: (event) => this.put(...state(event), false),
      move: (event) => this.put(...state(event), false),
      up: (event) => this.put(...state(event), true),
    });
  }

  /** Returns the angular velocity of the drag's last 0.1 s, in rad/s. */
  flickSpeed(now) {
    const recent = this.moves.filter(([time]) => now - time <= FLICK_TIME);
    if (recent.length < 2) return 0;
    const [[start, from], [end, to]] = [recent[0], recent.at(-1)];
    return clipped((to - from) / Math.max(end - start, 0.01), MAX_SPEED);
  }

  #drag(canvas, { down, move, up }) {
    let pointer = null; // the one that drags; other fingers do nothing
    canvas.addEventListener("pointerdown", (event) => {
      if (pointer !== null || event.button !== 0) return;
      pointer = event.pointerId;
      canvas.setPointerCapture(pointer);
      down(event);
    });
    canvas.addEventListener("pointermove", (event) => event.pointerId === pointer && move(event));
    for (const end of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(end, (event) => {
        if (event.pointerId !== pointer) return;
        pointer = null;
        up(event);
      });
    }
  }
}
