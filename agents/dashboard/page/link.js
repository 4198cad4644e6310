// The link to the dashboard: asks for more when the last message is drawn, notices silence, and tries again for ever.

const SILENT_MS = 1500;
const AGAIN_MS = 1000;

export class Link {
  /** handlers: hello(told), update(told, pictures), state("live" | "stale" | "lost", since a Date's milliseconds). */
  constructor(handlers) {
    this.handlers = handlers;
    this.heard = Date.now();
    this.state = "waiting";
    this.frames = 0;
    setInterval(() => this.look(), 250);
    this.open();
  }

  open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/live`);
    socket.binaryType = "arraybuffer";
    socket.onmessage = ({ data }) => {
      if (typeof data === "string") this.handlers.hello(JSON.parse(data));
      else this.take(data);
      // A page that nobody looks at draws nothing, and so asks for nothing.
      requestAnimationFrame(() => socket.readyState === WebSocket.OPEN && socket.send("more"));
    };
    socket.onclose = () => {
      this.become("lost");
      setTimeout(() => this.open(), AGAIN_MS);
    };
  }

  take(data) {
    const length = new DataView(data).getUint32(0, true);
    const told = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
    let at = 4 + length;
    const pictures = (told.shots ?? []).map(([type, size]) => {
      const picture = new Blob([new Uint8Array(data, at, size)], { type });
      at += size;
      return picture;
    });
    this.heard = Date.now();
    this.frames += 1;
    this.become("live");
    this.handlers.update(told, pictures);
  }

  look() {
    const silent = Date.now() - this.heard;
    if (this.state === "live" && silent > SILENT_MS && !document.hidden) this.become("stale");
    if (this.state === "stale" || this.state === "lost") this.handlers.state(this.state, this.heard);
  }

  become(state) {
    if (this.state === state) return;
    this.state = state;
    this.handlers.state(state, this.heard);
  }
}
