"use strict";

const HATCH = 9; // px between two lines

/**
 * Returns the efforts of a map as a picture of `width` x `height` pixels. The efforts below 0 are
 * hatched, because both directions are equally dark.
 */
function mapPicture(efforts, colours, width, height) {
  const picture = new OffscreenCanvas(width, height);
  const context = picture.getContext("2d");
  drawCells(context, efforts, (effort) => (effort < 0 ? [0, 0, 0, 255] : [0, 0, 0, 0]));
  context.globalCompositeOperation = "source-in"; // lines there, and nothing elsewhere
  context.strokeStyle = colours.hatch;
  const sharpness = window.devicePixelRatio || 1;
  context.lineWidth = 1.2 * sharpness;
  context.beginPath();
  for (let x = -height; x < width; x += HATCH * sharpness) {
    context.moveTo(x, height);
    context.lineTo(x + height, 0);
  }
  context.stroke();
  context.globalCompositeOperation = "destination-over";
  drawCells(context, efforts, (effort) => [...colours.ofEffort(effort), 255]);
  return picture;
}

/** Draws a cell for each number of a square map over the whole canvas; `colourOf` returns RGBA. */
function drawCells(context, numbers, colourOf) {
  const size = Math.sqrt(numbers.length);
  const picture = new OffscreenCanvas(size, size);
  const pixel = picture.getContext("2d");
  const image = pixel.createImageData(size, size);
  const pixels = new Uint32Array(image.data.buffer); // little-endian
  const seen = new Map(); // a map has few different efforts
  numbers.forEach((number, i) => {
    if (!seen.has(number)) {
      const [red, green, blue, alpha] = colourOf(number);
      seen.set(number, (alpha << 24) | (blue << 16) | (green << 8) | red);
    }
    pixels[i] = seen.get(number);
  });
  pixel.putImageData(image, 0, 0);
  const { width, height } = context.canvas;
  // The centres of the outer cells lie on the edges.
  const [cellX, cellY] = [width / (size - 1), height / (size - 1)];
  context.imageSmoothingEnabled = false;
  context.drawImage(picture, -cellX / 2, -cellY / 2, width + cellX, height + cellY);
}

/**
 * Draws the phase plane: the map, and the paths of states over it, the second one dashed.
 * `pictureOf` returns the map's picture for its width and height in pixels.
 */
function drawPortrait(canvas, colours, task, pictureOf, paths) {
  const { context, width, height } = blank(canvas);
  const [left, right, top, bottom] = portraitEdges(width, height);
  const sharpness = canvas.width / width;
  const x = (theta) => left + placeOf(task, [theta, 0])[0] * (right - left);
  const y = (thetadot) => top + placeOf(task, [0, thetadot])[1] * (bottom - top);

  context.save();
  context.beginPath();
  context.rect(left, top, right - left, bottom - top);
  context.clip();
  context.imageSmoothingEnabled = false;
  const size = [right - left, bottom - top];
  const picture = pictureOf(...size.map((length) => Math.max(Math.round(length * sharpness), 1)));
  context.drawImage(picture, left, top, ...size);
  paths.forEach((path, i) => {
    for (const [colour, thickness] of [[colours.halo, 4.5], [colours.path, 2]]) {
      context.strokeStyle = colour;
      context.lineWidth = thickness;
      context.setLineDash(i && colour === colours.path ? [5, 5] : []);
      continuous(path, task).forEach((part) => line(context, part.map(([a, b]) => [x(a), y(b)])));
    }
  });
  context.restore();
  context.strokeStyle = colours.soft;
  context.lineWidth = 1;
  context.strokeRect(left, top, right - left, bottom - top);

  // The second network's circle is hollow, and below the first one's.
  for (const [i, path] of [...paths.entries()].reverse()) {
    const [theta, thetadot] = path.at(-1).slice(-2);
    [context.fillStyle, context.strokeStyle] = [colours.path, colours.halo];
    if (i) [context.fillStyle, context.strokeStyle] = [colours.halo, colours.path];
    context.lineWidth = 2.5;
    context.beginPath();
    context.arc(x(task.angle(theta)), y(thetadot), i ? 8 : 6.5, 0, 2 * Math.PI);
    context.fill();
    context.stroke();
  }

  context.fillStyle = colours.soft;
  const narrow = width < 240; // px
  const angles = task.angleTicks.filter((_, i) => !narrow || i % 2 === 0);
  for (const [theta, label] of angles) write(context, label, x(theta), bottom + 13);
  write(context, narrow ? "angle θ (rad)" : "angle θ (rad), 0 upright", (left + right) / 2, bottom + 31);
  for (const value of task.speedTicks) {
    const inside = clipped(y(value) - (top + bottom) / 2, (bottom - top) / 2 - 4);
    write(context, shown(value, Number.isInteger(value) ? 0 : 1), left - 6, inside + (top + bottom) / 2, "right");
  }
  context.translate(12, (top + bottom) / 2);
  context.rotate(-Math.PI / 2);
  write(context, "velocity θ̇ (rad/s)", 0, 0);
}

/** Splits the path where the angle jumps from π to -π; both parts continue beyond the edge. */
function continuous(path, task) {
  const parts = [];
  let part = [];
  let shift = 0;
  for (const state of path) {
    const [theta, thetadot] = state.slice(-2);
    const here = task.angle(theta) - theta;
    if (part.length && Math.abs(here - shift) > 1) {
      const [before, speed] = part.at(-1);
      part.push([theta + shift, thetadot]);
      parts.push(part);
      part = [[before - shift + here, speed]];
    }
    shift = here;
    part.push([theta + here, thetadot]);
  }
  return [...parts, part];
}
