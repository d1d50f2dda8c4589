/* Browsers start no Worker on pages that are opened as files. There a hidden frame takes its place, so that the search of
   these pages works from a folder as it does over http. */
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      this.waiting = [];
      const frame = document.createElement("iframe");
      frame.hidden = true;
      frame.title = "search";
      document.body.appendChild(frame);
      url = new URL(url, document.baseURI);
      const inside = (this.inside = frame.contentWindow);
      const page = inside.document;
      page.open();
      page.write("<!DOCTYPE html><html><head><title>search</title></head><body></body></html>");
      page.close();
      const load = (source) =>
        new Promise((done, failed) => {
          const script = page.createElement("script");
          script.src = new URL(source, url).href;
          script.onload = done;
          script.onerror = () => failed(new Error("cannot load " + source));
          page.body.appendChild(script);
        });
      inside.importScripts = (...sources) => sources.reduce((before, s) => before.then(() => load(s)), Promise.resolve());
      inside.postMessage = (data) => this.answer("message", { data });
      load(url).then(
        () => {
          this.ready = true;
          this.waiting.splice(0).forEach((data) => this.hand(data));
        },
        (error) => this.answer("error", { message: error.message })
      );
    }
    answer(type, values) {
      const event = Object.assign(new Event(type), values);
      setTimeout(() => {
        this.dispatchEvent(event);
        if (this["on" + type]) this["on" + type](event);
      });
    }
    hand(data) {
      this.inside.dispatchEvent(new this.inside.MessageEvent("message", { data }));
    }
    postMessage(data) {
      if (this.ready) this.hand(data);
      else this.waiting.push(data);
    }
    terminate() {
      this.inside.frameElement.remove();
    }
  };
}
