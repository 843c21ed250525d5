"use strict";

const [BETA_1, BETA_2] = [0.9, 0.999]; // Keras's defaults

/** Returns the learning rate of an update, of which 0 is the first; Keras's CosineDecay. */
function learningRate(settings, update, totalUpdates) {
  const { learning_rate: rate, learning_rate_min: lowest, learning_rate_schedule: schedule } = settings;
  if (schedule === "constant") return rate;
  const share = Math.min(update / Math.max(totalUpdates, 1), 1);
  return lowest + (rate - lowest) * 0.5 * (1 + Math.cos(Math.PI * share));
}

/** Adam (Kingma & Ba 2015) as Keras computes it, or AdamW with AMSGrad; all in one loop. */
class Optimizer {
  constructor(settings, count) {
    this.settings = settings;
    this.updates = 0;
    this.totalUpdates = totalUpdates(settings);
    this.means = new Float64Array(count);
    this.squares = new Float64Array(count);
    const { optimizer, average_updates: averaged } = settings;
    this.highest = optimizer === "adamw" ? new Float64Array(count) : null; // AMSGrad's squares
    this.average = averaged > 1 ? new Float64Array(count) : null;
    this.momentum = 1 - 1 / Math.max(1, Math.min(averaged, Math.floor(this.totalUpdates / 10)));
  }

  /** Changes the weights by one update. */
  apply(weights, gradients) {
    const { settings, means, squares, highest, average } = this;
    const { optimizer_epsilon: epsilon } = settings;
    const rate = learningRate(settings, this.updates, this.totalUpdates);
    const limit = settings.gradient_clip ?? Infinity;
    const kept = highest ? 1 - settings.weight_decay * rate : 1;
    const momentum = this.updates ? this.momentum : 0;
    this.updates += 1;
    const step =
      (rate * Math.sqrt(1 - BETA_2 ** this.updates)) / (1 - BETA_1 ** this.updates);
    for (let i = 0; i < weights.length; i++) {
      const gradient = Math.min(Math.max(gradients[i], -limit), limit);
      const mean = (means[i] += (gradient - means[i]) * (1 - BETA_1));
      let square = (squares[i] += (gradient * gradient - squares[i]) * (1 - BETA_2));
      if (highest) square = highest[i] = Math.max(highest[i], square);
      weights[i] = weights[i] * kept - (step * mean) / (Math.sqrt(square) + epsilon);
    }
    if (!average) return;
    for (let i = 0; i < weights.length; i++) {
      average[i] = momentum * average[i] + (1 - momentum) * weights[i];
    }
  }

  /** Replaces the weights by their moving average, unless the first weights still count in it. */
  averageWeights(weights) {
    if (this.average && this.momentum ** this.updates < 1e-3) weights.set(this.average);
  }
}

/** Returns the number of updates of a whole run with updates after each episode. */
function totalUpdates({ episodes, warmup_episodes: warmup, updates_per_episode: each }) {
  return Math.max(0, episodes - warmup) * each;
}
