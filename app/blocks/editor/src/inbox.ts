// What the window tells the page, in its order. A long program takes a second to make, in which the page paints nothing:
// the canvas is covered first, so that nobody takes the blocks of before for those of the new title.
import {t} from './words';

/** A program as long as this may take longer than an eye blinks. */
const LARGE_PAYLOAD_LENGTH = 12_000;
/** A page that nobody sees paints nothing: it waits no longer than this. */
const HIDDEN_PAGE_TIMEOUT_MS = 100;

export class Inbox {
  private waiting: [name: string, payload: string][] | null = null;
  private readonly cover = document.createElement('div');

  constructor(private readonly receive: (name: string, payload: string) => void) {
    this.cover.className = 'nepOpening';
    this.cover.setAttribute('role', 'status');
  }

  dispatch(name: string, payload: string): void {
    if (this.waiting) this.waiting.push([name, payload]);
    else if (name === 'tab' && payload.length >= LARGE_PAYLOAD_LENGTH) this.dispatchAfterPaint(name, payload);
    else this.receive(name, payload);
  }

  private dispatchAfterPaint(name: string, payload: string): void {
    this.waiting = [[name, payload]];
    this.cover.textContent = t('Opening…');
    document.body.append(this.cover);
    let isDone = false;
    const go = () => {
      if (isDone) return;
      isDone = true;
      const queued = this.waiting ?? [];
      this.waiting = null;
      try {
        for (const [each, its] of queued) this.receive(each, its);
      } finally {
        this.cover.remove();
      }
    };
    window.requestAnimationFrame(() => window.setTimeout(go));
    window.setTimeout(go, HIDDEN_PAGE_TIMEOUT_MS);
  }
}
