"use strict";

/** The effort of a policy over the phase plane, computed in small portions, coarse cells first. */
class PolicyMap {
  constructor(policy, task) {
    this.policy = policy; // its method `effort` returns one for a state
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

  theta(column) {
    return ((2 * column) / (this.size - 1) - 1) * this.task.rightward * this.task.largest[0];
  }

  thetadot(row) {
    return (1 - (2 * row) / (this.size - 1)) * this.task.largest[1];
  }

  /** Computes for about `milliseconds`; returns whether the map has changed. */
  work(milliseconds) {
    if (this.ready) return false;
    const end = performance.now() + milliseconds;
    do {
      const { value, done } = this.#cells.next();
      if (done) {
        this.ready = true;
        break;
      }
      const [row, column, width] = value;
      const effort = this.policy.effort([...this.others, this.theta(column), this.thetadot(row)]);
      for (let i = row; i < Math.min(row + width, this.size); i++) {
        const j = i * this.size + column;
        this.efforts.fill(effort, j, Math.min(j + width, (i + 1) * this.size));
      }
    } while (performance.now() < end);
    return true;
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
