"use strict";

/**
 * Returns θ and θ̇ at a place of the phase portrait: shares of its width from the left, and of its
 * height from above. What leans to the right is on the right.
 */
function stateAt(task, [x, y]) {
  const [angle, speed] = task.largest;
  return [(2 * x - 1) * task.rightward * angle, (1 - 2 * y) * speed];
}

/** Returns the place of θ and θ̇ on the phase portrait. */
function placeOf(task, [theta, thetadot]) {
  const [angle, speed] = task.largest;
  return [((task.rightward * theta) / angle + 1) / 2, (1 - thetadot / speed) / 2];
}

/** Returns θ and θ̇ of a cell of a map with `size` rows and columns, of which row 0 is the highest. */
function cellState(task, size, row, column) {
  return stateAt(task, [column / (size - 1), row / (size - 1)]);
}

/** Returns the edges of the phase portrait in a canvas: left, right, top, bottom. */
function portraitEdges(width, height) {
  return [46, width - 10, 8, height - 40];
}

/** Returns where a pointer is on the phase portrait in a canvas. */
function pointedPlace(canvas, event) {
  const { left: x, top: y, width, height } = canvas.getBoundingClientRect();
  const [left, right, top, bottom] = portraitEdges(width, height);
  return [(event.clientX - x - left) / (right - left), (event.clientY - y - top) / (bottom - top)];
}
