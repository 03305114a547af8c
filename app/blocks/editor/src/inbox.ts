// Queue of messages from the window, processed in order. Loading a long behaviour blocks painting for about a
// second: the canvas is covered first, so that the old blocks aren't shown under the new title.
import type {WindowMessage} from './messages';
import {t} from './words';

/** Length of a message above which loading can be noticeably slow. */
const LARGE_MESSAGE_LENGTH = 12_000;
/** Fallback for a hidden page, which is never painted. */
const HIDDEN_PAGE_TIMEOUT_MS = 100;

export class Inbox {
  private waiting: WindowMessage[] | null = null;
  private readonly cover = document.createElement('div');

  constructor(private readonly receive: (message: WindowMessage) => void) {
    this.cover.className = 'nepOpening';
    this.cover.setAttribute('role', 'status');
  }

  /** Processes a message; `length` is the length of its JSON. */
  dispatch(message: WindowMessage, length: number): void {
    if (this.waiting) this.waiting.push(message);
    else if (message.type === 'showTab' && length >= LARGE_MESSAGE_LENGTH) this.dispatchAfterPaint(message);
    else this.receive(message);
  }

  private dispatchAfterPaint(message: WindowMessage): void {
    this.waiting = [message];
    this.cover.textContent = t('Opening…');
    document.body.append(this.cover);
    let isDone = false;
    const dispatchQueued = () => {
      if (isDone) return;
      isDone = true;
      const queued = this.waiting ?? [];
      this.waiting = null;
      try {
        for (const each of queued) this.receive(each);
      } finally {
        this.cover.remove();
      }
    };
    window.requestAnimationFrame(() => window.setTimeout(dispatchQueued));
    window.setTimeout(dispatchQueued, HIDDEN_PAGE_TIMEOUT_MS);
  }
}
