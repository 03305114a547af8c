// Channel to the window: each call carries one message as JSON. `messages.ts` lists the messages; those of
// each direction arrive in the order in which they were sent.
import type {PageMessage} from './messages';

/** Object of the window that the page can access (`app/ui/blockly/bridge.py`). */
export interface Bridge {
  message(json: string): void;
  message_sent: {connect(receive: (json: string) => void): void};
}

let bridge: Bridge | null = null;

/** Connects the page to the window; `receive` is called with each message as JSON. */
export function connect(window: Bridge, receive: (json: string) => void): void {
  bridge = window;
  bridge.message_sent.connect(receive);
}

/** Sends a message to the window. A workspace, which is JSON already, follows the other fields on a second line. */
export function send(message: PageMessage): void {
  if ('workspace' in message) {
    const {workspace, ...head} = message;
    bridge?.message(`${JSON.stringify(head)}\n${workspace}`);
  } else {
    bridge?.message(JSON.stringify(message));
  }
}

/** Throws for a message without a handler; the type check fails if the call can be reached. */
export function rejectUnhandled(message: never): never {
  throw new Error(`no handler for ${JSON.stringify(message).slice(0, 200)}`);
}
