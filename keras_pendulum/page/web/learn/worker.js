"use strict";

// The scripts of the page up to this one, which use no document: the worker runs the same ones.
const WORKER_SOURCE = [...document.scripts]
  .filter(({ type }) => type !== "application/json")
  .slice(0, -1)
  .map(({ textContent }) => textContent)
  .join("\n");

/** A worker that runs methods of WorkerMethods beside the page. */
class LearningWorker {
  #worker;
  #waiting = new Map(); // functions of the answers, by the numbers of the calls

  constructor({ gravity, optimum, learning }) {
    const source = new Blob([WORKER_SOURCE, "\nserveWorker(self);"], { type: "text/javascript" });
    const address = URL.createObjectURL(source);
    this.#worker = new Worker(address);
    URL.revokeObjectURL(address);
    this.#worker.onmessage = ({ data: { id, result, problem } }) => {
      const { resolve, reject } = this.#waiting.get(id);
      this.#waiting.delete(id);
      if (problem === undefined) resolve(result);
      else reject(new Error(problem));
    };
    this.#worker.onerror = ({ message }) => this.#rejectAll(message);
    this.#worker.postMessage({ gravity, optimum, learning }); // what it needs of the page's content
  }

  /** Runs a method; returns a promise of its result. */
  call(method, argument = {}) {
    const id = (this.calls = (this.calls ?? 0) + 1);
    return new Promise((resolve, reject) => {
      this.#waiting.set(id, { resolve, reject });
      this.#worker.postMessage({ id, method, argument });
    });
  }

  /** Ends the worker; calls without an answer reject. */
  end() {
    this.#worker.terminate();
    this.#rejectAll("the worker has ended");
  }

  #rejectAll(message) {
    for (const { reject } of this.#waiting.values()) reject(new Error(message));
    this.#waiting.clear();
  }
}
