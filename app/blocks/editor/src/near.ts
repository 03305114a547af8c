// Which gap a block in the hand is near: judged by where the blocks lay when it was taken.
import * as Blockly from 'blockly/core';

type Point = Blockly.utils.Coordinate;

interface Pair {
  local: Blockly.RenderedConnection;
  neighbour: Blockly.RenderedConnection;
}

interface Candidate extends Pair {
  distance: number;
}

/** What Blockly keeps to itself. */
interface Strategy {
  workspace: Blockly.WorkspaceSvg;
  /** All that could be joined; made once when a block is taken. */
  allConnectionPairs: Pair[];
  cacheAllConnectionPairs(): void;
  getClosestCandidate(block: Blockly.BlockSvg, delta: Point): Candidate | null;
  getSearchRadius(): number;
  currCandidateIsBetter(current: Candidate, delta: Point, other: Candidate): boolean;
}

/**
 * Where the gaps are, as a person sees them who aims at one.
 *
 * The preview of a gap on the way pushes apart what lies below it. A fast hand is past it before that can be seen, and
 * what it let go would join the block above the one it was let go at.
 */
const connectionPositions = new WeakMap<Strategy, Map<Blockly.RenderedConnection, Point>>();

function getConnectionPositions(strategy: Strategy): Map<Blockly.RenderedConnection, Point> {
  const cached = connectionPositions.get(strategy);
  if (cached) return cached;
  // What the block was taken out of closes up first.
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
  if (radius === Infinity) return baseGetClosestCandidate.call(this, block, delta);  // the keys go from gap to gap
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
