// The one WebSocket: status in, commands out, and whether what is shown can still be believed.
import { Lateness } from './age';
import { History } from './history';
import { CLOSED, type Reply, type Session, type Status, type Welcome } from './protocol';
import { WITHOUT_EPOCH, type Action, type Commands, type Tags } from './tables';

const TICK_MS = 50;
/** Kept off the limit, so that stale data are shown stale within it. */
const MARGIN_MS = 100;
const ALIVE_MS = 400;
const NO_ANSWER_MS = 2000;

type Note = Pick<Reply, 'ok' | 'code' | 'text' | 'values'>;

class Link {
  session = $state.raw<Session | null>(null);
  /** False until the service was asked who we are. */
  asked = $state(false);
  open = $state(false);
  stale = $state(true);
  /** Milliseconds since data were fresh. */
  age_ms = $state(0);
  tags = $state.raw<Partial<Tags>>({});
  welcome = $state.raw<Welcome | null>(null);
  note = $state.raw<Note | null>(null);
  /** This page has control. */
  mine = $derived(this.welcome !== null && this.tags.authority_client === this.welcome.client);
  readonly history = new History();
  /** Receives refusals without a waiting caller: those of `renew`. */
  refused: (reply: Reply) => void = () => {};
  /** Called with every status and every tick. */
  watch: () => void = () => {};
  /** Called with every status that is fresh. */
  readonly heard = new Set<() => void>();
  /** Called with every status, after its values are in force. */
  framed: () => void = () => {};

  #socket: WebSocket | null = null;
  #seq = 0;
  #frame = '';
  #freshAt = 0;
  #wait_ms = 500;
  #aliveAt = 0;
  #lateness = new Lateness();
  #replies = new Map<number, (reply: Reply) => void>();

  constructor() {
    setInterval(() => this.#tick(), TICK_MS);
  }

  /** Ask who we are, and connect when we may. */
  async start(): Promise<void> {
    try {
      const answer = await fetch('/api/v1/session');
      if (answer.ok) this.session = (await answer.json()) as Session;
      else if (answer.status === 401) this.session = null;
      else throw new Error(String(answer.status));
      this.asked = true;
      if (this.session !== null) this.#connect();
    } catch {
      this.#later();
    }
  }

  may(action: Action): boolean {
    return this.welcome?.may.includes(action) ?? false;
  }

  /** Age of the newest status, now. */
  since(): number {
    return this.#freshAt === 0 ? Infinity : performance.now() - this.#freshAt;
  }

  /** Send a command; its reply is shown, and returned. */
  async send<K extends keyof Commands>(type: K, keys: Commands[K]): Promise<Reply> {
    const seq = this.#post(type, keys);
    const reply = seq === 0 ? noAnswer('off') : await this.#reply(seq);
    this.note = reply;
    return reply;
  }

  /** Send what has no reply but a refusal. False when there is no connection. */
  post<K extends keyof Commands>(type: K, keys: Commands[K]): boolean {
    return this.#post(type, keys) !== 0;
  }

  async logout(): Promise<void> {
    await fetch('/api/v1/logout', {
      method: 'POST',
      headers: { 'Content-Type': 'application/json' },
      body: '{}',
    }).catch(() => {});
    this.session = null;
    this.#socket?.close();
  }

  #post<K extends keyof Commands>(type: K, keys: Commands[K]): number {
    if (this.#socket?.readyState !== WebSocket.OPEN) return 0;
    const epoch = WITHOUT_EPOCH.has(type) ? {} : { epoch: this.tags.epoch ?? 0 };
    this.#seq += 1;
    this.#socket.send(JSON.stringify({ type, seq: this.#seq, frame: this.#frame, ...epoch, ...keys }));
    return this.#seq;
  }

  #reply(seq: number): Promise<Reply> {
    return new Promise((resolve) => {
      const timer = setTimeout(() => settle(noAnswer('silent')), NO_ANSWER_MS);
      const settle = (reply: Reply): void => {
        clearTimeout(timer);
        this.#replies.delete(seq);
        resolve(reply);
      };
      this.#replies.set(seq, settle);
    });
  }

  #connect(): void {
    const scheme = location.protocol === 'https:' ? 'wss:' : 'ws:';
    const socket = new WebSocket(`${scheme}//${location.host}/api/v1/socket`);
    this.#socket = socket;
    this.#seq = 0;
    // One that is still closing while the next is open must not take its place.
    socket.onmessage = (event) => {
      if (socket === this.#socket)
        this.#receive(JSON.parse(event.data as string) as Welcome | Status | Reply);
    };
    socket.onclose = (event) => {
      if (socket === this.#socket) this.#closed(event.code);
    };
  }

  #closed(code: number): void {
    this.open = false;
    this.#socket = null;
    this.#judge(true);
    // These were sent, and may have been executed.
    for (const settle of [...this.#replies.values()]) settle(noAnswer('silent'));
    if (code === CLOSED.session) this.session = null;
    else if (this.session !== null) this.#later();
  }

  #later(): void {
    setTimeout(() => void this.start(), this.#wait_ms);
    this.#wait_ms = Math.min(2 * this.#wait_ms, 4000);
  }

  #receive(message: Welcome | Status | Reply): void {
    if (message.type === 'welcome') {
      this.welcome = message;
      const { user, person, role, may } = message;
      this.session = { user, person, role, may };
      this.tags = {};
      this.#lateness = new Lateness();
      this.open = true;
      this.#wait_ms = 500;
    } else if (message.type === 'status') {
      this.#status(message);
    } else {
      if (message.epoch !== null) this.tags = { ...this.tags, epoch: message.epoch };
      const settle = this.#replies.get(message.seq);
      if (settle) settle(message);
      else if (!message.ok) this.refused(message);
    }
  }

  #status(status: Status): void {
    const now = performance.now();
    const late_ms = Math.max(this.#lateness.of(status.tags.issued_ms ?? 0, now), status.age_ms ?? Infinity);
    this.#frame = status.frame;
    this.tags = { ...this.tags, ...status.tags };
    if (status.fresh && late_ms < this.#limit_ms()) {
      this.#freshAt = now - late_ms;
      this.history.add(this.tags, (Date.now() - late_ms) / 1000);
      this.heard.forEach((hear) => hear());
    }
    this.#judge();
    // At once with a fresh frame: the controller measures the round trip by it, and takes no old ones.
    if (this.mine && !this.stale && now - this.#aliveAt > ALIVE_MS) {
      this.#aliveAt = now;
      this.post('alive', {});
    }
    this.framed();
    this.watch();
  }

  #tick(): void {
    this.#judge();
    this.watch();
  }

  #limit_ms(): number {
    return (this.welcome?.stale_ms ?? 500) - MARGIN_MS;
  }

  #judge(closed = false): void {
    const stale = closed || !this.open || this.since() > this.#limit_ms();
    if (stale && !this.stale) this.history.gap();
    this.stale = stale;
    if (stale) this.age_ms = this.since();
  }
}

function noAnswer(code: 'off' | 'silent'): Reply {
  return { type: 'reply', seq: 0, ok: false, code: '', text: code, values: {}, epoch: null, journal: 0 };
}

export const link = new Link();
