"use strict";

/** The exact Q-values of a discounted task. */
class ExactValues {
  /**
   * @param {Task} task
   * @param {number} discount
   * @param {function} value returns the optimal value of a state.
   */
  constructor(task, discount, value) {
    Object.assign(this, { task, discount, value });
  }

  /** Returns the Q-value of each effort in a state. */
  qValues(state, efforts) {
    return efforts.map((effort) => {
      const { state: next, reward, over } = this.task.advanced(state, effort);
      return reward + (over ? 0 : this.discount * this.value(next));
    });
  }
}
