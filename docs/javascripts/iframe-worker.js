// A page that was opened from a folder (file:) may not start a worker: there the theme's search runs in a hidden frame.
// The theme looks for the name IFrameWorker. Only what its search uses is here: messages in both directions.
// A worker from a text of the page itself, as the playground's, may start.
if (location.protocol === "file:") {
  const Started = window.Worker;
  window.Worker = window.IFrameWorker = class IFrameWorker extends EventTarget {
    constructor(url) {
      super();
      if (String(url).startsWith("blob:")) return new Started(url);
      const frame = document.createElement("iframe");
      frame.hidden = true;
      document.body.append(frame);
      const inside = frame.contentWindow;
      inside.postMessage = (data) => this.dispatchEvent(new MessageEvent("message", { data }));
      const script = frame.contentDocument.createElement("script");
      this.loaded = new Promise((done) => script.addEventListener("load", done));
      script.src = new URL(url, document.baseURI);
      frame.contentDocument.body.append(script);
      this.frame = frame;
    }

    postMessage(data) {
      this.loaded.then(() => this.frame.contentWindow.dispatchEvent(new MessageEvent("message", { data })));
    }

    terminate() {
      this.frame.remove();
    }
  };
}
