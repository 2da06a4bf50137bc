// Messages of the service: docs/reference/service.md is the contract.
import type { Action, Role, Tags, Values } from './tables';

export interface Session {
  user: string;
  /** Whose account it is. */
  person: string;
  role: Role;
  may: Action[];
}

export interface Welcome extends Session {
  type: 'welcome';
  client: string;
  /** Where this page is; it is slow without the enabling switch unless it has proved to be on the machine. */
  place: 'console' | 'remote';
  version: string;
  lease_ms: number;
  renew_ms: number;
  key_view_max_ms: number;
  round_trip_max_ms: number;
  stale_ms: number;
}

export interface Status {
  type: 'status';
  /** Its mark for this connection: sent back as it is with every command. */
  frame: string;
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
  values: Values;
  epoch: number | null;
  journal: number;
}

/** Close codes of the service. */
export const CLOSED = { session: 4401, tooMany: 4429, tooSlow: 4408 } as const;
