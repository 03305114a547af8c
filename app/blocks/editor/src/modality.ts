// Focus rings for keyboard users only: shown from the first Tab, arrow key or F6, hidden by a click.
import * as Blockly from 'blockly/core';

const NAVIGATION_KEYS = /^(Tab|Arrow(Up|Down|Left|Right)|Home|End|PageUp|PageDown|F6)$/;

/** Records whether the last navigation was by keyboard. */
export function setKeyboardLed(isLed: boolean): void {
  document.documentElement.classList.toggle('nepKeys', isLed);
  Blockly.keyboardNavigationController.setIsActive(isLed);
}

export function isKeyboardLed(): boolean {
  return document.documentElement.classList.contains('nepKeys') || Blockly.keyboardNavigationController.getIsActive();
}

/** Starts tracking whether the user works by keyboard or mouse. */
export function trackInputModality(): void {
  document.addEventListener('pointerdown', () => setKeyboardLed(false), true);
  document.addEventListener('keydown', (event) => {
    // In a text field, arrow keys move the cursor.
    const isTyping = event.target instanceof HTMLInputElement || event.target instanceof HTMLTextAreaElement;
    if (NAVIGATION_KEYS.test(event.key) && (!isTyping || event.key === 'Tab')) document.documentElement.classList.add('nepKeys');
  }, true);
}
