"use strict";

const AVERAGED_EPISODES = 10; // of the learning curve, as in the pictures of a run

/** Returns the means of the last values up to each one. */
function trailingMeans(values, count = AVERAGED_EPISODES) {
  let sum = 0;
  return values.map((value, i) => {
    sum += value - (i >= count ? values[i - count] : 0);
    return sum / Math.min(i + 1, count);
  });
}

/**
 * Draws curves over the episodes of a run.
 *
 * @param {{points: number[][], colour: string, dashed: boolean}[]} series
 * @param {{end: number, ticks: number[], y: function, title: string}} axis `y` returns the share of
 *   the height for a value; `ticks` are values.
 */
function drawCurves(canvas, colours, series, { end, ticks, y: share, title }) {
  const { context, width, height } = blank(canvas);
  const [left, right, top, bottom] = [46, width - 10, 26, height - 22];
  const x = (episode) => left + (episode / end) * (right - left);
  const y = (value) => bottom - clippedShare(share(value)) * (bottom - top);
  context.font = "12px system-ui, sans-serif";
  context.lineWidth = 1;
  context.fillStyle = colours.soft;
  write(context, title, left - 40, 8, "left");
  for (const tick of ticks) {
    context.strokeStyle = colours.line;
    line(context, [[left, y(tick)], [right, y(tick)]]);
    write(context, shown(tick, Number.isInteger(tick) ? 0 : 1), left - 6, y(tick), "right");
  }
  write(context, "0", left, height - 10);
  write(context, `${end} episodes`, right, height - 10, "right");
  for (const { points, colour, dashed } of series) {
    if (!points.length) continue;
    context.strokeStyle = context.fillStyle = colour;
    context.lineWidth = 2;
    context.setLineDash(dashed ? [6, 4] : []);
    line(context, points.map(([episode, value]) => [x(episode), y(value)]));
    context.setLineDash([]);
    const [episode, value] = points.at(-1);
    dot(context, x(episode), y(value), 3.5);
  }
}

/** Returns the axis of the returns: from the lowest to the highest point, with round ticks. */
function returnAxis(series, end, title) {
  const values = series.flatMap(({ points }) => points.map(([, value]) => value));
  const [lowest, highest] = values.length ? [Math.min(...values), Math.max(...values)] : [-1, 0];
  const span = highest - lowest || 1;
  const power = 10 ** Math.floor(Math.log10(span));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((each) => span / each <= 4);
  const ticks = [];
  for (let tick = Math.ceil(lowest / step) * step; tick <= highest + 1e-9; tick += step) ticks.push(tick);
  return { end, ticks, y: (value) => (value - lowest) / span, title };
}

/** Returns the axis of the regret: logarithmic, because regrets extend from 1 to 1000. */
function regretAxis(series, end, title) {
  const values = series.flatMap(({ points }) => points.map(([, value]) => value));
  const highest = Math.ceil(Math.log10(Math.max(10, ...values)));
  const lowest = Math.floor(Math.log10(Math.max(0.1, Math.min(1, ...values))));
  const powers = Array.from({ length: highest - lowest + 1 }, (_, i) => lowest + i);
  return {
    end,
    ticks: powers.map((power) => 10 ** power),
    y: (value) => (Math.log10(Math.max(value, 10 ** lowest)) - lowest) / (highest - lowest),
    title,
  };
}
