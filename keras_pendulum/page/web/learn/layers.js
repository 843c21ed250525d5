"use strict";

const ERROR_SHARE = 0.25; // of the range of the exact values: the end of the scale of errors

/** The layers of the learned maps: their numbers, their colours and the ends of their scales. */
class Layers {
  /**
   * @param {Task} task
   * @param {object} colours see `readColours`.
   * @param {?{values: Float32Array}} exact the map of the exact values; null where it is not known.
   */
  constructor(task, colours, exact) {
    Object.assign(this, { task, colours, exact });
    this.range = exact && [Math.min(...exact.values), Math.max(...exact.values)];
  }

  /** Returns the picture of a layer of a map, `width` x `height` pixels; null where it has none. */
  picture(layer, map, width, height) {
    if (layer === "effort") return mapPicture(map.efforts, this.colours, width, height);
    const numbers = this.#numbers(layer, map);
    if (!numbers) return null;
    const [lowest, highest] = this.ends(layer, map);
    const share = (value) => clippedShare((value - lowest) / (highest - lowest || 1));
    const colourOf = (value) => [...this.#colour(layer, share(value)), 255];
    const picture = new OffscreenCanvas(width, height);
    drawCells(picture.getContext("2d"), numbers, colourOf);
    return picture;
  }

  /** Returns the lowest and the highest number of the scale. */
  ends(layer, map) {
    if (layer === "effort") return [-this.task.maxEffort, this.task.maxEffort];
    if (layer === "error") {
      const largest = this.range ? ERROR_SHARE * (this.range[1] - this.range[0]) : 1;
      return [-largest, largest];
    }
    if (layer === "visits") return [0, Math.log1p(map?.visits ? Math.max(...map.visits) : 1)];
    if (this.range) return this.range;
    return map ? [Math.min(...map.values), Math.max(...map.values)] : [0, 1];
  }

  #numbers(layer, { values, visits }) {
    if (layer === "value") return values;
    if (layer === "visits") return visits && visits.map(Math.log1p);
    return this.exact && values.map((value, i) => value - this.exact.values[i]);
  }

  #colour(layer, share) {
    const { minus, none, plus, accent, ink } = this.colours;
    if (layer === "error") return share < 0.5 ? mixed(minus, none, 2 * share) : mixed(none, plus, 2 * share - 1);
    return mixed(none, layer === "visits" ? ink : accent, share);
  }
}
