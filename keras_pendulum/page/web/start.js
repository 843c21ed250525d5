"use strict";

/** Starts the page, or says why it cannot. */
async function start() {
  try {
    const recorded = JSON.parse(element("network").textContent);
    if (!recorded) throw new Error("it contains no network");
    recorded.optimum.table = await decodedWords(recorded.optimum.table);
    const records = [recorded, recorded.against].filter(Boolean);
    const task = new Task(recorded);
    const networks = records.map((each) => new Network(each, decodedFloats(each.weights), task));
    const optimum = new Optimum(recorded.optimum, task);
    const training = recorded.training && new Training(recorded, networks[0], task);
    element("about").textContent = [
      ...records.map((each) => about(each, task)),
      `Written by keras_pendulum ${recorded.version}.`,
    ].join(" ");
    element("elsewhere").textContent = elsewhereText(records, networkNames(recorded));
    document.title += `: ${recorded.name}`;
    const page = new Page(recorded, task, networks, optimum, training);
    /** Access to the page from the console and from tests. */
    window.pendulum = {
      page,
      reset: (...state) => page.restart(...state),
      step: () => page.step(),
      qValues: (observation) => Array.from(page.episode.network.qValues(observation)),
      state: () => {
        const { network, path, drivers, task: _, ...rest } = page.episode;
        const [theta, thetadot] = rest.state.slice(-2);
        return { ...rest, theta, thetadot, qValues: Array.from(rest.qValues) };
      },
    };
    startLearning(page);
    if (typeof Scenes === "function") window.pendulum.scenes = new Scenes(page);
  } catch (error) {
    element("problem").textContent = window.DecompressionStream
      ? `This page is damaged (${error.message}): write it again with python -m keras_pendulum.page.`
      : "This browser is too old for this page: it needs one of 2023 or later.";
    element("problem").hidden = false;
  }
}

/** Resolves to the numbers that `build.py` has compressed. */
async function decodedWords(text) {
  const compressed = new Blob([decodedBytes(text)]).stream();
  const stream = compressed.pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const words = new Uint16Array(bytes.length / 2); // the high bytes, then the low ones
  let word = 0;
  for (let i = 0; i < words.length; i++) {
    word += (bytes[i] << 8) | bytes[words.length + i]; // the difference from the word before
    words[i] = word;
  }
  return words;
}

start();
