"use strict";

const SECONDS_PER_NETWORK = 3; // while the training plays
const BASE64 = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
const SIX_BITS = new Uint8Array(128); // by the code of the character
[...BASE64].forEach((character, i) => (SIX_BITS[character.charCodeAt(0)] = i));

/** The networks of a training, and the slider, the curve and the button that move through them. */
class Training {
  /**
   * @param {object} recorded the content of the page. Its `training` has `episodes`, after which
   *   the networks were kept; `untrained`, the episodes before the first update; `curve`, the rewards of a step at even distances from the first to the
   *   last episode; `levels`, that of the best possible return and of random actions by name; and
   *   `networks`, all but the last one.
   * @param {Network} last the network after the last of the episodes.
   * @param {Task} task
   */
  constructor(recorded, last, task) {
    const { episodes, untrained, curve, levels, networks } = recorded.training;
    Object.assign(this, { recorded, episodes, untrained, curve, levels, task });
    if (networks.length !== episodes.length - 1) throw new Error("a network of its training is missing");
    this.shown = networks.length;
    this.playing = false;
    this.seconds = 0; // since the present network is shown, while playing
    this.changed = true; // whether the curve must be drawn again
    // Decoded when they are shown for the first time, with their maps.
    this.cache = [];
    this.cache[this.shown] = { network: last, map: new PolicyMap(last, task) };
  }

  /** Starts to listen to the slider; `replace` is called with each network and its map. */
  listen(replace) {
    this.replace = replace;
    const slider = element("snapshot");
    slider.max = this.episodes.length - 1;
    slider.addEventListener("input", () => {
      this.stop();
      this.show(Number(slider.value));
    });
    document.body.classList.add("with-training");
    for (const each of document.querySelectorAll("[data-training]")) each.hidden = false;
    this.#showTexts();
  }

  /** Shows the network of an index: map, Q-values and behaviour follow it. */
  show(index) {
    if (index === this.shown) return;
    this.shown = index;
    this.seconds = 0;
    this.cache[index] ??= this.#decoded(index);
    this.replace(this.cache[index].network, this.cache[index].map);
    this.#showTexts();
  }

  /** Starts or stops the play, at the end from the first network on; returns whether it plays. */
  toggle() {
    const start = !this.playing;
    if (start && this.shown === this.episodes.length - 1) this.show(0);
    this.seconds = 0;
    this.playing = start;
    this.#showTexts();
    return start;
  }

  stop() {
    if (this.playing) this.toggle();
  }

  /** Lets time pass; shows the next network when it is due. */
  advance(seconds) {
    if (!this.playing) return;
    // Limited, so that a tab that was hidden does not rush through the training.
    this.seconds += Math.min(seconds, 4 * this.task.timeStep);
    if (this.seconds < SECONDS_PER_NETWORK) return;
    if (this.shown === this.episodes.length - 1) this.stop();
    else this.show(this.shown + 1);
  }

  drawIfChanged(colours) {
    if (!this.changed) return;
    this.changed = false;
    const [here, end] = [this.episodes[this.shown], this.episodes.at(-1)];
    const colour = this.recorded.colour ?? colours.accent;
    drawCurve(element("curve"), { ...colours, curve: colour }, this, here, end);
  }

  #showTexts() {
    const [here, end] = [this.episodes[this.shown], this.episodes.at(-1)];
    const slider = element("snapshot");
    slider.value = this.shown;
    slider.setAttribute("aria-valuetext", `episode ${here} of ${end}`);
    const reward = curveValue(this.curve, here / end);
    const untrained = here <= this.untrained ? ", no update yet" : "";
    element("training-text").textContent =
      `episode ${here} of ${end}: ${this.task.curveName} ${shown(reward, 2)}${untrained}`;
    element("play-training").firstElementChild.textContent = this.playing ? "Stop" : "Play training";
    this.changed = true;
  }

  /** Returns a network and its map. The 12 bits of a weight are its share of its unit's largest. */
  #decoded(index) {
    const { kernels, halves } = this.recorded.training.networks[index];
    const { sizes } = this.recorded;
    const largestAndBiases = decodedHalves(halves); // of the units of each layer
    const numbers = new Float32Array((kernels.length + largestAndBiases.length) / 2);
    let [place, start, end] = [0, 0, 0];
    for (let layer = 1; layer < sizes.length; layer++) {
      const [inputs, units] = [sizes[layer - 1], sizes[layer]];
      for (let i = 0; i < inputs * units; i++, place += 2, end++) {
        const high = SIX_BITS[kernels.charCodeAt(place)];
        const low = SIX_BITS[kernels.charCodeAt(place + 1)];
        numbers[end] = ((64 * high + low - 2048) / 2047) * largestAndBiases[start + (i % units)];
      }
      numbers.set(largestAndBiases.subarray(start + units, start + 2 * units), end);
      start += 2 * units;
      end += units;
    }
    const network = new Network(this.recorded, numbers, this.task);
    return { network, map: new PolicyMap(network, this.task) };
  }
}
