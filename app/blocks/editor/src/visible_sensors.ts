// The sensors that the open toolbox shows: their values are wanted while it is open.
import * as Blockly from 'blockly/core';
import {sensorTypes} from './definitions';
import {sensorOf} from './overlays';

/** Calls `look` after whatever opens, fills or closes it. */
export function observeFlyout(flyout: Blockly.IFlyout, onChange: () => void): void {
  const {show, setVisible} = flyout;
  flyout.show = (contents) => {
    show.call(flyout, contents);
    queueMicrotask(onChange);
  };
  flyout.setVisible = (visible) => {
    setVisible.call(flyout, visible);
    queueMicrotask(onChange);
  };
}

/** Robot and sensor of each block in it; none while it is closed. */
export function visibleSensors(flyout: Blockly.IFlyout | null): [robot: string, sensor: string][] {
  if (!flyout?.isVisible()) return [];
  const blocks = [...sensorTypes()].flatMap((type) => flyout.getWorkspace().getBlocksByType(type, true));
  const sensors = new Map(blocks.map((block) => [sensorOf(block).join('/'), sensorOf(block)]));
  return [...sensors.values()].sort(([a, b], [c, d]) => (`${a}/${b}` < `${c}/${d}` ? -1 : 1));
}
