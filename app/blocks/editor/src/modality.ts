// Rings are for who uses the keyboard: a click never shows one, the first Tab, arrow or F6 does.
import * as Blockly from 'blockly/core';

const NAVIGATION_KEYS = /^(Tab|Arrow(Up|Down|Left|Right)|Home|End|PageUp|PageDown|F6)$/;

/** The keyboard led here, or the mouse did. */
export function setKeyboardLed(led: boolean): void {
  document.documentElement.classList.toggle('nepKeys', led);
  Blockly.keyboardNavigationController.setIsActive(led);
}

export function isKeyboardLed(): boolean {
  return document.documentElement.classList.contains('nepKeys') || Blockly.keyboardNavigationController.getIsActive();
}

/** Follows what the person uses from now on. */
export function trackInputModality(): void {
  document.addEventListener('pointerdown', () => setKeyboardLed(false), true);
  document.addEventListener('keydown', (event) => {
    // In a field arrows move the caret.
    const types = event.target instanceof HTMLInputElement || event.target instanceof HTMLTextAreaElement;
    if (NAVIGATION_KEYS.test(event.key) && (!types || event.key === 'Tab')) document.documentElement.classList.add('nepKeys');
  }, true);
}
