// Unpacks what the page holds, without a request: libraries and policies, which are compressed, and the
// page's own modules, which import each other by addresses that they get here.
"use strict";

(() => {
  const progress = document.getElementById("progress");
  const sources = new Map(); // of modules, by the name that others import them by

  const parts = {
    // Return the bytes of a part.
    async bytes(name) {
      const script = document.querySelector(`script[data-packed="${name}"]`);
      const compressed = Uint8Array.from(atob(script.textContent), (character) => character.charCodeAt(0));
      script.remove(); // it is unpacked only once
      const stream = new Blob([compressed]).stream().pipeThrough(new DecompressionStream("gzip"));
      return new Uint8Array(await new Response(stream).arrayBuffer());
    },

    async text(name) {
      return new TextDecoder().decode(await parts.bytes(name));
    },

    async json(name) {
      return JSON.parse(await parts.text(name));
    },

    // Start a worker that runs `hear` of `worker.js` for each message, and have it begin with the page's
    // content. It makes its own addresses: those of a page from disk are none of its.
    simulator(content) {
      const source = `const link = ${linked};
        let module = null;
        onmessage = async ({ data }) => {
          if (module) (await module).hear(data);
          else module = import(link(data)("./worker.js"));
        };`;
      const worker = new Worker(address(source)); // from disk, Chromium starts no worker that is a module itself
      worker.postMessage(sources);
      parts.bytes("mujoco.wasm").then((binary) => worker.postMessage(
        { kind: "begin", binary, content }, [binary.buffer]));
      return worker;
    },
  };

  // Return what gives the address of a module, in which the names that it imports are addresses.
  function linked(sources) {
    const addresses = new Map();
    return function address(name) {
      if (!addresses.has(name)) {
        const source = sources.get(name).replace(/^(import .*from |export .*from |import )(["'])(.+?)\2/gm,
          (_, start, quote, other) => `${start}"${address(other)}"`);
        addresses.set(name, URL.createObjectURL(new Blob([source], { type: "text/javascript" })));
      }
      return addresses.get(name);
    };
  }

  function address(source) {
    return URL.createObjectURL(new Blob([source], { type: "text/javascript" }));
  }

  function said(text) {
    progress.textContent = `Loading: ${text} …`;
  }

  async function begin() {
    if (!window.WebAssembly || !window.DecompressionStream) {
      throw new Error("it needs WebAssembly and DecompressionStream, which browsers have since 2023");
    }
    said("unpacking libraries");
    for (const script of document.querySelectorAll("script[data-module]")) {
      sources.set(script.dataset.module, script.textContent);
    }
    const content = JSON.parse(document.getElementById("content").textContent);
    const libraries = { "three.core.js": "./three.core.js", "three.module.js": "three", "mujoco.js": "mujoco" };
    await Promise.all(Object.entries(libraries).map(async ([file, name]) => sources.set(name, await parts.text(file))));
    const link = linked(sources);
    const { begin: start } = await import(link("./main.js"));
    window.page = await start(content, parts, said);
    progress.hidden = true;
  }

  begin().catch((error) => {
    progress.hidden = true;
    const failure = document.getElementById("failure");
    failure.hidden = false;
    failure.textContent = `This page cannot run here: ${error.message}`;
    throw error;
  });
})();
