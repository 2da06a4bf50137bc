// What a browser has and the model of one has not.
import { vi } from 'vitest';

vi.stubGlobal('visualViewport', null);
