"use strict";

/** Returns the colours of the style sheet in the present theme, light or dark. */
function readColours() {
  const style = getComputedStyle(document.documentElement);
  const names = ["card", "ink", "soft", "line", "rod", "accent", "minus", "none", "plus", "path"];
  const colours = Object.fromEntries(
    [...names, "halo"].map((name) => [name, style.getPropertyValue(`--${name}`).trim()]),
  );
  const channels = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
  const [minus, none, plus] = [colours.minus, colours.none, colours.plus].map(channels);
  /** Returns red, green and blue of a torque in N·m. */
  colours.ofTorque = (torque) => {
    const share = Math.abs(torque) / MAX_TORQUE;
    const end = torque < 0 ? minus : plus;
    return none.map((channel, i) => Math.round(channel + share * (end[i] - channel)));
  };
  return colours;
}

/** Clears a canvas at the resolution of the screen; returns its context and its size in CSS pixels. */
function blank(canvas) {
  const { clientWidth: width, clientHeight: height } = canvas;
  const sharpness = window.devicePixelRatio || 1;
  const [columns, rows] = [Math.round(width * sharpness), Math.round(height * sharpness)];
  if (canvas.width !== columns || canvas.height !== rows) {
    canvas.width = columns;
    canvas.height = rows;
  }
  const context = canvas.getContext("2d");
  context.setTransform(sharpness, 0, 0, sharpness, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = "13px system-ui, sans-serif";
  context.lineCap = context.lineJoin = "round";
  return { context, width, height };
}

function line(context, points) {
  context.beginPath();
  points.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
  context.stroke();
}

function write(context, text, x, y, align = "center", baseline = "middle") {
  context.textAlign = align;
  context.textBaseline = baseline;
  context.fillText(text, x, y);
}

/**
 * Draws the pendulum as Gymnasium does: upright at θ = 0, positive angles and torques
 * counter-clockwise. `trail` is an array of the last angles.
 */
function drawPendulum(canvas, colours, theta, torque, trail) {
  const { context, width, height } = blank(canvas);
  const narrow = width < 230; // no room for the labels at the sides
  const rod = Math.min(width / 2 - (narrow ? 14 : 52), height / 2 - 28);
  context.translate(width / 2, height / 2);
  const at = (angle, radius) => [-Math.sin(angle) * radius, -Math.cos(angle) * radius];

  context.strokeStyle = colours.line;
  context.lineWidth = 1.5;
  context.beginPath();
  context.arc(0, 0, rod + 8, 0, 2 * Math.PI);
  context.stroke();
  for (let i = 0; i < 12; i++) {
    const angle = (i * Math.PI) / 6;
    line(context, [at(angle, rod + 8), at(angle, rod + (i % 3 ? 4 : 0))]);
  }
  context.fillStyle = colours.soft;
  write(context, "0", 0, -rod - 18);
  write(context, "±π", 0, rod + 20);
  if (!narrow) {
    write(context, "π/2", -rod - 18, 0, "right");
    write(context, "−π/2", rod + 18, 0, "left");
  }

  context.strokeStyle = colours.rod;
  context.lineWidth = rod * 0.05;
  context.lineCap = "butt";
  trail.slice(1).forEach((angle, i) => {
    context.globalAlpha = (0.35 * (i + 1)) / trail.length;
    context.beginPath();
    const [from, to] = [-trail[i] - Math.PI / 2, -angle - Math.PI / 2];
    context.arc(0, 0, rod, Math.min(from, to), Math.max(from, to));
    context.stroke();
  });
  context.globalAlpha = 1;
  context.lineCap = "round";

  context.lineWidth = rod * 0.13;
  line(context, [[0, 0], at(theta, rod * 0.935)]);
  context.fillStyle = colours.card;
  context.beginPath();
  context.arc(0, 0, rod * 0.03, 0, 2 * Math.PI);
  context.fill();
  drawTorque(context, colours, rod, torque);
}

/** Draws a curved arrow below the pivot; its length is proportional to the torque. */
function drawTorque(context, colours, rod, torque) {
  if (Math.abs(torque) < 0.01) return;
  const radius = rod * 0.42;
  const sign = -Math.sign(torque); // a canvas counts angles clockwise
  const share = Math.abs(torque) / MAX_TORQUE;
  const span = share * (2 / 3) * Math.PI;
  const [start, end] = [Math.PI / 2 - (sign * span) / 2, Math.PI / 2 + (sign * span) / 2];
  const colour = torque < 0 ? colours.minus : colours.plus;
  const head = rod * (0.06 + 0.04 * share);
  const tip = end + (sign * head * 1.5) / radius;
  const point = (angle, distance) => [Math.cos(angle) * distance, Math.sin(angle) * distance];
  for (const [style, extra] of [[colours.card, rod * 0.035], [colour, 0]]) {
    context.strokeStyle = context.fillStyle = style;
    context.lineWidth = rod * 0.055 + extra;
    context.lineCap = "butt";
    context.beginPath();
    context.arc(0, 0, radius, start, end, sign < 0);
    context.stroke();
    context.beginPath();
    context.moveTo(...point(tip, radius));
    context.lineTo(...point(end, radius + head));
    context.lineTo(...point(end, radius - head));
    context.fill();
  }
}

/**
 * Returns round limits of an axis for `values`. The limits `before` stay as long as the values are
 * within them and fill a fifth of them, so that the axis does not move with every step.
 */
function steadyLimits(values, before) {
  const [lowest, highest] = [Math.min(...values), Math.max(...values)];
  const span = Math.max(highest - lowest, 1e-3);
  if (before && lowest >= before[0] && highest <= before[1] && 5 * span >= before[1] - before[0]) {
    return before;
  }
  const power = 10 ** Math.floor(Math.log10(span / 2));
  const unit = power * [5, 2, 1].find((factor) => factor * power <= span / 2);
  const low = Math.floor(lowest / unit) * unit;
  return [low, Math.max(Math.ceil(highest / unit) * unit, low + unit)];
}

/** Draws a bar for the Q-value of each torque between the `limits`, and marks `taken`. */
function drawBars(canvas, colours, torques, qValues, limits, best, taken) {
  const { context, width, height } = blank(canvas);
  const [left, right, top, bottom] = [76, width - 6, 12, height - 38];
  const [lowest, highest] = limits;
  const pitch = (right - left) / torques.length;
  const middle = (i) => left + (i + 0.5) * pitch;
  const floor = bottom - 4; // the lowest bar stays visible

  context.strokeStyle = colours.line;
  context.lineWidth = 1;
  line(context, [[left, top], [right, top]]);
  line(context, [[left, bottom], [right, bottom]]);
  context.fillStyle = colours.soft;
  const digits = clipped(Math.max(1 - Math.floor(Math.log10(highest - lowest)), 0), 4);
  for (const [value, y] of [[highest, top], [lowest, floor]]) {
    write(context, shown(value, digits), left - 6, y, "right");
  }
  context.save();
  context.translate(12, (top + bottom) / 2);
  context.rotate(-Math.PI / 2);
  write(context, "Q (return)", 0, 0);
  context.restore();

  qValues.forEach((value, i) => {
    const share = (value - lowest) / (highest - lowest);
    const y = floor - share * (floor - top);
    const [x, wide] = [middle(i) - pitch * 0.41, pitch * 0.82];
    context.fillStyle = i === best ? colours.ink : `rgb(${colours.ofTorque(torques[i])})`;
    context.fillRect(x, y, wide, bottom - y);
    if (i !== best) {
      context.strokeStyle = colours.soft;
      context.lineWidth = 0.5;
      context.strokeRect(x, y, wide, bottom - y);
    }
  });

  context.fillStyle = colours.soft;
  const place = (torque) =>
    middle(((torque + MAX_TORQUE) / (2 * MAX_TORQUE)) * (torques.length - 1));
  for (const torque of [-2, -1, 0, 1, 2]) {
    write(context, shown(torque, 0, torque !== 0), place(torque), bottom + 15);
  }
  write(context, "torque (N·m)", (left + right) / 2, bottom + 31);
  if (taken !== null) {
    context.fillStyle = colours.accent;
    const x = place(taken);
    context.beginPath();
    context.moveTo(x, bottom + 1);
    context.lineTo(x - 5, bottom + 8);
    context.lineTo(x + 5, bottom + 8);
    context.fill();
  }
}

/** Returns the torque map as a picture with one pixel per cell. */
function mapPicture(map, colours) {
  const picture = document.createElement("canvas");
  picture.width = picture.height = map.size;
  const context = picture.getContext("2d");
  const image = context.createImageData(map.size, map.size);
  map.torques.forEach((torque, i) => image.data.set([...colours.ofTorque(torque), 255], 4 * i));
  context.putImageData(image, 0, 0);
  return picture;
}

/** Returns the edges of the map in a canvas: left, right, top, bottom. */
function portraitEdges(width, height) {
  return [46, width - 10, 8, height - 40];
}

/** Draws the phase plane: the map, and the paths of [θ, θ̇] over it, the second one dashed. */
function drawPortrait(canvas, colours, picture, paths) {
  const { context, width, height } = blank(canvas);
  const [left, right, top, bottom] = portraitEdges(width, height);
  const x = (theta) => left + ((theta / Math.PI + 1) / 2) * (right - left);
  const y = (thetadot) => top + ((1 - thetadot / MAX_SPEED) / 2) * (bottom - top);

  context.save();
  context.beginPath();
  context.rect(left, top, right - left, bottom - top);
  context.clip();
  // The centres of the outer cells lie on the edges.
  const [cellX, cellY] = [(right - left) / (picture.width - 1), (bottom - top) / (picture.height - 1)];
  context.imageSmoothingEnabled = false;
  context.drawImage(
    picture,
    left - cellX / 2,
    top - cellY / 2,
    right - left + cellX,
    bottom - top + cellY,
  );
  paths.forEach((path, i) => {
    for (const [colour, thickness] of [[colours.halo, 4.5], [colours.path, 2]]) {
      context.strokeStyle = colour;
      context.lineWidth = thickness;
      context.setLineDash(i && colour === colours.path ? [5, 5] : []);
      continuous(path).forEach((part) => line(context, part.map(([a, b]) => [x(a), y(b)])));
    }
  });
  context.restore();
  context.strokeStyle = colours.soft;
  context.lineWidth = 1;
  context.strokeRect(left, top, right - left, bottom - top);

  // The second network's circle is hollow, and below the first one's.
  for (const [i, path] of [...paths.entries()].reverse()) {
    const [theta, thetadot] = path.at(-1);
    [context.fillStyle, context.strokeStyle] = [colours.path, colours.halo];
    if (i) [context.fillStyle, context.strokeStyle] = [colours.halo, colours.path];
    context.lineWidth = 2.5;
    context.beginPath();
    context.arc(x(wrapped(theta)), y(thetadot), i ? 8 : 6.5, 0, 2 * Math.PI);
    context.fill();
    context.stroke();
  }

  context.fillStyle = colours.soft;
  ["−π", "−π/2", "0", "π/2", "π"].forEach((text, i) => {
    write(context, text, left + (i / 4) * (right - left), bottom + 13);
  });
  write(context, "angle θ (rad), 0 upright", (left + right) / 2, bottom + 31);
  for (const value of [-8, -4, 0, 4, 8]) {
    const inside = clipped(y(value) - (top + bottom) / 2, (bottom - top) / 2 - 4);
    write(context, shown(value, 0), left - 6, inside + (top + bottom) / 2, "right");
  }
  context.translate(12, (top + bottom) / 2);
  context.rotate(-Math.PI / 2);
  write(context, "velocity θ̇ (rad/s)", 0, 0);
}

/** Splits the path where it jumps from π to -π; both parts continue beyond the edge. */
function continuous(path) {
  const parts = [];
  let part = [];
  let shift = 0;
  for (const [theta, thetadot] of path) {
    const here = wrapped(theta) - theta;
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

/** Formats a number with a typographic minus sign; `plus` adds the sign of positive numbers. */
function shown(value, digits, plus = false) {
  const text = value.toFixed(digits);
  const zero = Number(text) === 0;
  if (zero) return text.replace("-", "");
  return text.replace("-", "−").replace(/^(?=\d)/, plus ? "+" : "");
}
