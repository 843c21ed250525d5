"use strict";

/**
 * What the address of the page says of a lesson, such as `#fault=no-target&seed=3&controls=off`.
 *
 * `fault` names switches, with commas; `network` is such as 64-64; `speed` is in episodes per second.
 */
function readAddress(hash, { settings, switches }) {
  const words = new URLSearchParams(hash.replace(/^#/, ""));
  const isLesson = ["learn", "fault", "seed", "network", "speed"].some((word) => words.has(word));
  const known = new Set(switches.map(({ name }) => name));
  const faults = (words.get("fault") ?? "").split(",").filter(Boolean);
  const units = (words.get("network") ?? "").split("-").map(Number);
  const isNetwork = units.length <= 8 && units.every((each) => Number.isInteger(each) && each > 0 && each <= 1024);
  const seed = Number(words.get("seed") ?? settings.seed);
  const speed = Number(words.get("speed") ?? 0);
  return {
    isLesson,
    faults: faults.filter((name) => known.has(name)),
    unknown: faults.filter((name) => !known.has(name)),
    seed: Number.isInteger(seed) && seed >= 0 && seed < 2 ** 32 ? seed : settings.seed,
    units: isNetwork ? units : settings.hidden_units,
    speed: speed > 0 ? speed : 0, // 0: as fast as it can
    hasControls: words.get("controls") !== "off",
  };
}

/** Writes a lesson into the address, without a new entry in the browser's history. */
function writeAddress({ faults, seed, units, speed, hasControls }, { settings }) {
  const words = ["learn"];
  if (faults.length) words.push(`fault=${faults.join(",")}`);
  words.push(`seed=${seed}`);
  if (String(units) !== String(settings.hidden_units)) words.push(`network=${units.join("-")}`);
  if (speed) words.push(`speed=${speed}`);
  if (!hasControls) words.push("controls=off");
  history.replaceState(null, "", `#${words.join("&")}`);
}
