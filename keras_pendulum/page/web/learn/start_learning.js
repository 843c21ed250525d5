"use strict";

const FRAME_SHARE = 6; // ms of a frame for the drawing of a lesson

/** Starts the part of the page that learns; its workers start when it is shown for the first time. */
function startLearning(page) {
  const { recorded, task } = page;
  const { learning } = recorded;
  let [lesson, view, controls] = [null, null, null];
  let [parts, isDue] = [[], false]; // still to be drawn; whether to draw anew afterwards
  const draw = () => {
    const end = performance.now() + FRAME_SHARE;
    while (parts.length && performance.now() < end) parts.shift()();
    if (!parts.length && isDue) {
      isDue = false;
      controls.update();
      parts = view.parts();
    }
    if (parts.length) requestAnimationFrame(draw);
  };
  const redraw = () => {
    if (!view || element("learn").hidden) return;
    if (!parts.length && !isDue) requestAnimationFrame(draw);
    isDue = true;
  };
  const fail = ({ message }) => {
    element("learning-status").textContent = `This browser cannot train: ${message}.`;
  };
  const open = () => {
    try {
      if (!lesson) create();
      redraw();
    } catch (error) {
      fail(error);
    }
  };
  const create = () => {
    lesson = new Lesson(recorded, task, readAddress(location.hash, learning), redraw);
    view = new LessonView(lesson, task);
    controls = new LessonControls(lesson, view, redraw);
    element("sweep").hidden = !lesson.canSweep;
    const sizes = new ResizeObserver(redraw);
    document.querySelectorAll("#learn canvas").forEach((canvas) => sizes.observe(canvas));
    measureTimes(recorded, controls).catch(fail);
    lesson.solve(page.optimum).catch(fail);
  };
  const tabs = new Tabs((name) => {
    if (name === "learn") open();
    else {
      lesson?.run(false);
      page.redraw();
    }
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    view?.recolour();
    redraw();
  });
  addEventListener("hashchange", () => {
    const choices = readAddress(location.hash, learning);
    if (!choices.isLesson) return;
    if (lesson) lesson.choose(choices);
    tabs.show("learn");
  });
  if (readAddress(location.hash, learning).isLesson) tabs.show("learn");
  window.pendulum.train = (settings = {}) => trainInPage(recorded, settings);
  Object.defineProperty(window.pendulum, "lesson", { get: () => lesson });
}

/** Measures some updates of the default network, and shows the time of a run with each size. */
async function measureTimes(recorded, controls) {
  const worker = new LearningWorker(recorded);
  const { settings, action_count: actions } = recorded.learning;
  const { secondsPerUpdate, inputs } = await worker.call("measure");
  worker.end();
  const products = (units) =>
    [...units, actions].reduce((sum, each, i) => sum + each * [inputs, ...units][i], 0);
  const updates = totalUpdates(settings);
  const unit = (updates * secondsPerUpdate) / products(settings.hidden_units);
  controls.showTimes((units) => unit * products(units));
}
