"use strict";

/** Returns the names of the networks on the page. */
function networkNames(recorded) {
  if (!recorded.against) return ["network"];
  const names = [recorded, recorded.against].map(({ name }) => name.replace(/\.(weights\.)?h5$/, ""));
  return names[0] === names[1] ? names.map((name, i) => `${name} (${i + 1})`) : names;
}

/** Returns whether a network was trained at another gravity than that of the page. */
function isElsewhere({ gravity, trainedGravity }) {
  return trainedGravity !== null && trainedGravity !== gravity;
}

/** Returns a warning behind the title where a network was trained at another gravity, else "". */
function elsewhereText(records, names) {
  const texts = records.flatMap((each, i) => {
    if (!isElsewhere(each)) return [];
    return `${records.length > 1 ? `${names[i]} ` : ""}trained at ${each.trainedGravity}`;
  });
  return texts.length ? [` at g = ${records[0].gravity} m/s²`, ...texts].join(", ") : "";
}

/** Returns the text on a network. */
function about(record, task) {
  const { name, preset, sizes, activation, trainedGravity, evaluatedReturn } = record;
  const from = preset && !name.startsWith(`${preset}.`) ? ` (preset ${preset})` : "";
  const sentences = [
    `${name}${from}, a ${sizes.slice(1, -1).join("-")} ${activation} network with ` +
      task.about(sizes.at(-1)),
  ];
  const elsewhere = isElsewhere(record);
  if (elsewhere) {
    sentences.push(`Another gravity than in training: it was trained at g = ${trainedGravity} m/s².`);
  }
  if (evaluatedReturn !== null) {
    const where = elsewhere ? " there" : "";
    sentences.push(`Mean return when evaluated${where}: ${shown(evaluatedReturn, 2)}.`);
  }
  return sentences.join(" ");
}

/** Returns the status: who drives, and whether time is paused or the system is held. */
function statusText({ episode, task, other, running, heldByKey }) {
  if (heldByKey) {
    const [theta, thetadot] = episode.state.slice(-2);
    return `Held at ${shown(task.angle(theta), 2)} rad, ${shown(thetadot, 2)} rad/s. Enter lets go.`;
  }
  const networks = other ? "Both networks drive." : "The network drives.";
  const driver = episode.youDrive ? "You drive." : networks;
  return running ? driver : `Paused. ${driver}`;
}
