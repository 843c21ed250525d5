"use strict";

try {
  const recorded = JSON.parse(element("network").textContent);
  if (!recorded) throw new Error("it contains no network");
  const records = [recorded, recorded.against].filter(Boolean);
  const networks = records.map((each) => new Network(each, decodedFloats(each.weights)));
  const optimum = new Optimum(recorded.optimum, recorded.gravity);
  const training = recorded.training && new Training(recorded, networks[0]);
  element("about").textContent = [
    ...records.map(about),
    `Written by keras_pendulum ${recorded.version}.`,
  ].join(" ");
  element("elsewhere").textContent = elsewhereText(records, networkNames(recorded));
  document.title = `Inverted pendulum: ${recorded.name}`;
  const page = new Page(recorded, networks, optimum, training);
  /** Access to the page from the console and from tests. */
  window.pendulum = {
    page,
    reset: (theta, thetadot) => page.restart(theta, thetadot),
    step: () => page.step(),
    qValues: (observation) => Array.from(page.episode.network.qValues(observation)),
    state: () => {
      const { network, path, drivers, ...rest } = page.episode;
      return { ...rest, qValues: Array.from(rest.qValues), over: page.episode.over };
    },
  };
} catch (error) {
  element("problem").textContent =
    `This page is damaged (${error.message}): write it again with python -m keras_pendulum.page.`;
  element("problem").hidden = false;
}
