// Converts design tokens to a Blockly theme and CSS variables.
import * as Blockly from 'blockly/core';
import {SAME_STYLE, categories, colour, roles} from './tokens';

const FONT_FAMILY = 'Inter, "Noto Sans", "M PLUS 1p", "Noto Sans CJK JP", sans-serif';
let themeCount = 0;

export function makeTheme(): Blockly.Theme {
  const blockStyles: Record<string, Partial<Blockly.Theme.BlockStyle>> = {};
  const categoryStyles: Record<string, Blockly.Theme.CategoryStyle> = {};
  for (const [name, each] of categories()) {
    blockStyles[name] = {
      colourPrimary: each.primary, colourSecondary: each.secondary, colourTertiary: each.tertiary,
      hat: name === 'events' ? 'cap' : '',
    };
    categoryStyles[name] = {colour: each.primary};
  }
  for (const [other, ours] of Object.entries(SAME_STYLE)) {
    const style = blockStyles[ours];
    if (style) blockStyles[other] = {...style, hat: other === 'hat_blocks' ? 'cap' : ''};
  }
  const grey = {colourPrimary: colour('sunken'), colourSecondary: colour('sunken'),
    colourTertiary: colour('borderStrong')};
  blockStyles['kept'] = {...grey, hat: ''};
  blockStyles['kept_hat'] = {...grey, hat: 'cap'};
  themeCount += 1;
  return Blockly.Theme.defineTheme(`nep${themeCount}`, {
    name: `nep${themeCount}`,
    blockStyles,
    categoryStyles,
    componentStyles: {
      workspaceBackgroundColour: colour('workspace'),
      toolboxBackgroundColour: colour('panel'),
      toolboxForegroundColour: colour('text'),
      flyoutBackgroundColour: colour('panel'),
      flyoutForegroundColour: colour('text'),
      flyoutOpacity: 1,
      scrollbarColour: colour('borderStrong'),
      scrollbarOpacity: 0.5,
      insertionMarkerColour: colour('accent'),
      insertionMarkerOpacity: 0.35,
      selectedGlowColour: colour('focus'),
      cursorColour: colour('focus'),
    },
    fontStyle: {family: FONT_FAMILY, weight: '600', size: 11.5},
    startHats: false,
  });
}

/** Sets a CSS variable `--nep-<role>` for each colour role and `--nep-block-<category>` for each block category. */
export function setCssVariables(isDark: boolean): void {
  const style = document.documentElement.style;
  for (const [role, value] of roles()) style.setProperty(`--nep-${role}`, value);
  for (const [name, {primary}] of categories()) style.setProperty(`--nep-block-${name}`, primary);
  style.setProperty('--nep-families', FONT_FAMILY);
  style.setProperty('color-scheme', isDark ? 'dark' : 'light');
}
