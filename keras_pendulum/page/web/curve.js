"use strict";

const CURVE_AXIS = 40; // px for the numbers beside the curve; training.css indents the slider as much
const HALF_THUMB = 8; // px, of the slider below the curve

/** Returns the value of a curve of evenly spaced points at a share of its length. */
function curveValue(curve, share) {
  return curve[Math.round(share * (curve.length - 1))];
}

/**
 * Draws the learning curve in the colour `curve`, dashed lines at `levels`, and a cursor at the
 * episode `here`.
 */
function drawCurve(canvas, colours, { curve, levels }, here, end) {
  const { context, width, height } = blank(canvas);
  const [left, right, top, bottom] = [CURVE_AXIS + HALF_THUMB, width - HALF_THUMB, 5, height - 5];
  const all = [...curve, ...Object.values(levels)];
  const [lowest, highest] = [Math.min(...all), Math.max(...all)];
  const x = (share) => left + share * (right - left);
  const y = (value) => bottom - ((value - lowest) / (highest - lowest || 1)) * (bottom - top);

  context.fillStyle = colours.soft;
  context.font = "11px system-ui, sans-serif";
  for (const value of [highest, lowest]) {
    write(context, shown(value, 1), CURVE_AXIS - 4, y(value), "right");
  }
  context.strokeStyle = colours.line;
  context.lineWidth = 1;
  line(context, [[CURVE_AXIS, top], [CURVE_AXIS, bottom], [right, bottom]]);
  context.setLineDash([3, 4]);
  context.strokeStyle = colours.soft;
  for (const [name, value] of Object.entries(levels)) {
    line(context, [[CURVE_AXIS, y(value)], [right, y(value)]]);
    // The name is on the side of the line that has more space.
    const below = y(value) < (top + bottom) / 2;
    write(context, name, right, y(value) + (below ? 8 : -8), "right");
  }
  context.setLineDash([]);
  context.strokeStyle = colours.curve;
  context.lineWidth = 2;
  line(context, curve.map((value, i) => [x(i / (curve.length - 1 || 1)), y(value)]));
  context.strokeStyle = context.fillStyle = colours.ink;
  context.lineWidth = 1.5;
  const cursor = x(here / end);
  line(context, [[cursor, 0], [cursor, height]]);
  dot(context, cursor, y(curveValue(curve, here / end)), 4);
}
