// Messages of the service: docs/reference/service.md is the contract.
import type { Action, Role, Tags } from './tables';

export interface Session {
  user: string;
  role: Role;
  may: Action[];
}

export interface Welcome extends Session {
  type: 'welcome';
  client: string;
  /** Where this page is; a remote one is slow without the enabling switch. */
  place: 'local' | 'loopback' | 'remote';
  version: string;
  frame_ms: number;
  lease_ms: number;
  renew_ms: number;
  frames_max_jog: number;
  frames_max: number;
  stale_ms: number;
}

export interface Status {
  type: 'status';
  frame: number;
  fresh: boolean;
  age_ms: number | null;
  tags: Partial<Tags>;
}

export interface Reply {
  type: 'reply';
  seq: number;
  ok: boolean;
  code: string;
  text: string;
  epoch: number | null;
  journal: number;
}

export type Direction = 'forward' | 'reverse';
/** What takes two steps. */
export type Arms = 'brake_test' | 'reset_locked';

/** Commands with the keys that are theirs; the link adds type, seq, frame and epoch. */
export interface Commands {
  alive: Record<string, never>;
  take: { over: boolean };
  give: Record<string, never>;
  power: { on: boolean };
  mode: { mode: NonNullable<Tags['mode']> };
  jog: { lease: string; direction: Direction };
  renew: { lease: string };
  release: { lease: string };
  increment: { direction: Direction };
  move: { target_deg: number };
  halt: Record<string, never>;
  stop: Record<string, never>;
  quick_stop: Record<string, never>;
  reset: Record<string, never>;
  acknowledge: { id: number };
  set: { tag: keyof Tags; value: number };
  arm: { action: Arms };
  brake_test: Record<string, never>;
}

export const WITHOUT_EPOCH = new Set<keyof Commands>(['alive', 'release', 'stop', 'quick_stop']);

/** Close codes of the service. */
export const CLOSED = { session: 4401, tooMany: 4429, tooSlow: 4408 } as const;
