// Sensors shown in the open flyout; their values are requested while it is open.
import * as Blockly from 'blockly/core';
import {sensorTypes} from './definitions';
import {sensorOf} from './overlays';

/** Calls `onChange` after the flyout is opened, filled or closed. */
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

/** Returns the robot and sensor of each block in the flyout; none if it is closed. */
export function visibleSensors(flyout: Blockly.IFlyout | null): [robot: string, sensor: string][] {
  if (!flyout?.isVisible()) return [];
  const blocks = [...sensorTypes()].flatMap((type) => flyout.getWorkspace().getBlocksByType(type, true));
  const sensors = new Map(blocks.map((block) => [sensorOf(block).join('/'), sensorOf(block)]));
  return [...sensors.values()].sort(([a, b], [c, d]) => (`${a}/${b}` < `${c}/${d}` ? -1 : 1));
}
