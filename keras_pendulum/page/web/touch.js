"use strict";

const FLICK_TIME = 0.1; // s before the release that determine the speed of a flick

/**
 * Lets a pointer move the system: a drag moves a number of the state, such as the angle, its last
 * movement is the speed, and a press on the phase portrait chooses θ and θ̇.
 */
class Touch {
  constructor(page) {
    this.page = page;
    this.moves = []; // [time in s, value] of the present drag
  }

  listenToSystem(canvas, episode) {
    const { page } = this;
    const { task } = page;
    let [state, grip] = [null, 0]; // while it is dragged, and which number of it
    const place = (event) => {
      const { left, top, width, height } = canvas.getBoundingClientRect();
      return [[event.clientX - left, event.clientY - top], [width, height]];
    };
    const move = (event) => {
      state[grip] = task.gripped(state, grip, ...place(event));
      this.moves.push([event.timeStamp / 1000, state[grip]]);
      page.put(state, false);
    };
    this.#drag(canvas, {
      down: (event) => {
        this.moves = [];
        grip = task.grip(episode.state, ...place(event));
        state = [...episode.state];
        state[grip + 1] = 0;
        move(event);
      },
      move,
      up: (event) => {
        const speed = clipped(this.flickSpeed(event.timeStamp / 1000), task.limits[grip + 1]);
        state[grip + 1] = speed;
        page.put(state, true);
      },
    });
  }

  listenToPortrait(canvas) {
    const { page } = this;
    const put = (event, released) => {
      const state = stateAt(page.task, pointedPlace(canvas, event).map(clippedShare));
      page.putOnPortrait(...state, released);
    };
    const hold = (event) => put(event, false);
    this.#drag(canvas, { down: hold, move: hold, up: (event) => put(event, true) });
  }

  /** Returns the speed of the drag's last 0.1 s. */
  flickSpeed(now) {
    const recent = this.moves.filter(([time]) => now - time <= FLICK_TIME);
    if (recent.length < 2) return 0;
    const [[start, from], [end, to]] = [recent[0], recent.at(-1)];
    return (to - from) / Math.max(end - start, 0.01);
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
