"use strict";

/** A Q-network that can learn. `gradients` is one array, like the weights to which they belong. */
class LearningNetwork extends DenseNetwork {
  constructor(sizes, activation) {
    super(sizes, activation, new Float64Array(countWeights(sizes)));
    this.gradients = new Float64Array(this.weights.length);
    const ofWeights = ({ byteOffset, length }) => new Float64Array(this.gradients.buffer, byteOffset, length);
    for (const layer of this.layers) {
      layer.kernelGradients = ofWeights(layer.kernels);
      layer.biasGradients = ofWeights(layer.biases);
      layer.turned = new Float64Array(layer.kernels.length);
    }
  }

  /** Draws the initial weights as the setting `initial_weights` says, see dqn/network.py. */
  initialize(rule, random) {
    this.layers.forEach(({ inputs, units, kernels, biases }, i) => {
      const isHead = i === this.layers.length - 1;
      const fanIn = inputs ** -0.5;
      const spread = rule === "spread" && !isHead;
      const limit = rule === "fan-in" || (spread && i === 0) ? fanIn : Math.sqrt(6 / (inputs + units));
      const biasLimit = rule === "fan-in" ? fanIn : spread ? 0.3 : 0;
      for (let k = 0; k < kernels.length; k++) kernels[k] = random.within(limit);
      for (let k = 0; k < units; k++) biases[k] = random.within(biasLimit);
    });
  }

  /** Writes the Q-values [rows] of the actions [rows] that were taken in observations [rows, D]. */
  takenValues(observations, actions, rows, values) {
    const { kernels, biases, inputs, units } = this.layers.at(-1);
    const features = this.hidden(observations, rows);
    for (let row = 0; row < rows; row++) {
      const action = actions[row];
      let sum = biases[action];
      for (let i = 0; i < inputs; i++) sum += features[row * inputs + i] * kernels[i * units + action];
      values[row] = sum;
    }
  }

  /**
   * Writes the gradients of a loss, after `takenValues` of the same observations. `slopes` [rows] are
   * its derivatives by the values of the actions taken; those by all other outputs are 0.
   */
  backward(observations, actions, rows, slopes) {
    this.gradients.fill(0);
    const head = this.layers.length - 1;
    this.#backwardHead(head ? this.outputs[head - 1] : observations, actions, rows, slopes);
    for (let i = head - 1; i >= 0; i--) {
      const { inputs, units, kernels, kernelGradients, biasGradients, turned } = this.layers[i];
      const [output, deltas] = [this.outputs[i], this.deltas[i]];
      const { slope } = this.layers[i].activation;
      for (let row = 0, k = 0; row < rows; row++) {
        for (let unit = 0; unit < units; unit++, k++) {
          deltas[k] *= slope(output[k]);
          biasGradients[unit] += deltas[k];
        }
      }
      const features = i ? this.outputs[i - 1] : observations;
      addProduct(kernelGradients, features, 1, inputs, deltas, inputs, rows, units);
      if (!i) break;
      transpose(turned, kernels, inputs, units);
      this.deltas[i - 1].fill(0, 0, rows * inputs);
      addProduct(this.deltas[i - 1], deltas, units, 1, turned, rows, units, inputs);
    }
  }

  #backwardHead(features, actions, rows, slopes) {
    const head = this.layers.length - 1;
    const { inputs, units, kernels, kernelGradients, biasGradients } = this.layers[head];
    const deltas = this.deltas[head - 1];
    for (let row = 0; row < rows; row++) {
      const [action, slope] = [actions[row], slopes[row]];
      biasGradients[action] += slope;
      for (let i = 0; i < inputs; i++) {
        const [here, weight] = [row * inputs + i, i * units + action];
        kernelGradients[weight] += slope * features[here];
        if (deltas) deltas[here] = slope * kernels[weight];
      }
    }
  }

  reserve(rows) {
    super.reserve(rows);
    this.deltas = this.layers.map(({ units }) => new Float64Array(rows * units));
  }
}
