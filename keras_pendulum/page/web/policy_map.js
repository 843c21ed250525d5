"use strict";

/** The effort of a policy over the phase plane, computed in small portions, coarse cells first. */
class PolicyMap {
  constructor(policy, task) {
    this.policy = policy; // its method `effort` returns one for a state, or `effortsOf` those of two
    this.task = task;
    this.size = task.mapSize; // columns of θ as the portrait has them, rows of θ̇ from above
    this.efforts = new Float32Array(this.size ** 2);
    this.others = null;
    this.aim(task.aimed.map(() => 0));
  }

  #cells;

  /** Chooses the other numbers of the states, such as the position of the cart; a small change is none. */
  aim(others) {
    if (this.others?.every((value, i) => Math.abs(value - others[i]) <= this.task.aimed[i])) return;
    this.#cells = this.#coarseToFine(this.ready ? 4 : 16);
    this.others = others;
    this.ready = false;
  }

  /** Computes for about `milliseconds`; returns whether the map has changed. */
  work(milliseconds) {
    if (this.ready) return false;
    const end = performance.now() + milliseconds;
    do {
      const cells = [this.#cells.next(), this.#cells.next()].filter(({ done }) => !done);
      if (!cells.length) {
        this.ready = true;
        break;
      }
      this.#compute(cells.map(({ value }) => value));
    } while (performance.now() < end);
    return true;
  }

  /** Writes the efforts of two cells: [row, column, width] each. */
  #compute(cells) {
    const { policy, task, others, size } = this;
    const states = cells.map(([row, column]) => [...others, ...cellState(task, size, row, column)]);
    const efforts = policy.effortsOf?.(states) ?? states.map((state) => policy.effort(state));
    cells.forEach(([row, column, width], k) => {
      for (let i = row; i < Math.min(row + width, size); i++) {
        const j = i * size + column;
        this.efforts.fill(efforts[k], j, Math.min(j + width, (i + 1) * size));
      }
    });
  }

  *#coarseToFine(coarsest) {
    for (let width = coarsest; width >= 1; width /= 2) {
      for (let row = 0; row < this.size; row += width) {
        for (let column = 0; column < this.size; column += width) {
          const computed = width < coarsest && row % (2 * width) === 0 && column % (2 * width) === 0;
          if (!computed) yield [row, column, width];
        }
      }
    }
  }
}
