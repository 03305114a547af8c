// Search for the nearest connection of a dragged block, based on the positions at the start of the drag.
import * as Blockly from 'blockly/core';

type Point = Blockly.utils.Coordinate;

interface Pair {
  local: Blockly.RenderedConnection;
  neighbour: Blockly.RenderedConnection;
}

interface Candidate extends Pair {
  distance: number;
}

/** Members that Blockly doesn't export. */
interface Strategy {
  workspace: Blockly.WorkspaceSvg;
  /** All possible connections, cached at the start of a drag. */
  allConnectionPairs: Pair[];
  cacheAllConnectionPairs(): void;
  getClosestCandidate(block: Blockly.BlockSvg, delta: Point): Candidate | null;
  getSearchRadius(): number;
  currCandidateIsBetter(current: Candidate, delta: Point, other: Candidate): boolean;
}

/**
 * Positions of the connections at the start of the drag, which are those the user aims at.
 *
 * The insertion preview pushes the blocks below it apart. A fast drag passes it before the blocks have moved on
 * screen, and would connect to the block above the intended one.
 */
const connectionPositions = new WeakMap<Strategy, Map<Blockly.RenderedConnection, Point>>();

function getConnectionPositions(strategy: Strategy): Map<Blockly.RenderedConnection, Point> {
  const cached = connectionPositions.get(strategy);
  if (cached) return cached;
  // Close the gap that the dragged block left first.
  Blockly.renderManagement.triggerQueuedRenders(strategy.workspace);
  const positions = new Map<Blockly.RenderedConnection, Point>();
  for (const {neighbour} of strategy.allConnectionPairs) {
    if (!positions.has(neighbour)) positions.set(neighbour, new Blockly.utils.Coordinate(neighbour.x, neighbour.y));
  }
  connectionPositions.set(strategy, positions);
  return positions;
}

function distance({local, neighbour}: Pair, delta: Point, positions: Map<Blockly.RenderedConnection, Point>): number {
  const position = positions.get(neighbour) ?? neighbour;
  return Math.hypot(local.x + delta.x - position.x, local.y + delta.y - position.y);
}

const strategy = Blockly.dragging.BlockDragStrategy.prototype as unknown as Strategy;

const baseCacheAllConnectionPairs = strategy.cacheAllConnectionPairs;
strategy.cacheAllConnectionPairs = function () {
  connectionPositions.delete(this);
  baseCacheAllConnectionPairs.call(this);
};

const baseGetClosestCandidate = strategy.getClosestCandidate;
strategy.getClosestCandidate = function (block, delta) {
  const radius = this.getSearchRadius();
  if (radius === Infinity) return baseGetClosestCandidate.call(this, block, delta);  // by keyboard, the block moves from connection to connection
  const positions = getConnectionPositions(this);
  let best: Candidate | null = null;
  for (const pair of this.allConnectionPairs) {
    const candidateDistance = distance(pair, delta, positions);
    if (candidateDistance > radius || (best && candidateDistance >= best.distance) || pair.neighbour.getSourceBlock().isDeadOrDying()) continue;
    best = {...pair, distance: candidateDistance};
  }
  return best;
};

strategy.currCandidateIsBetter = function (current, delta, other) {
  if (this.getSearchRadius() === Infinity) return false;
  return other.distance > distance(current, delta, getConnectionPositions(this)) - Blockly.config.currentConnectionPreference;
};
