// Queue of messages from the window, processed in order. Loading a long behaviour blocks painting for about a
// second: the canvas is covered first, so that the old blocks aren't shown under the new title.
import {t} from './words';

/** Payload length above which loading can be noticeably slow. */
const LARGE_PAYLOAD_LENGTH = 12_000;
/** Fallback for a hidden page, which is never painted. */
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
    const dispatchQueued = () => {
      if (isDone) return;
      isDone = true;
      const queued = this.waiting ?? [];
      this.waiting = null;
      try {
        for (const [queuedName, queuedPayload] of queued) this.receive(queuedName, queuedPayload);
      } finally {
        this.cover.remove();
      }
    };
    window.requestAnimationFrame(() => window.setTimeout(dispatchQueued));
    window.setTimeout(dispatchQueued, HIDDEN_PAGE_TIMEOUT_MS);
  }
}
