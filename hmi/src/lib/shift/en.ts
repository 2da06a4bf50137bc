// English texts of alarm sound, shift log, people and help.
export const en = {
  sound: 'Alarm sound',
  sound_off: 'off',
  sound_on: 'on',
  sound_blocked: 'Alarm sound is on, but this browser keeps it silent until you press a key or click here.',
  shift_log: 'Shift log',
  shift_line: 'A line for the shift log',
  shift_write: 'Write',
  here_now: 'Here now',
  has_control: 'has control',
  place_remote: 'remote screen',
  control_local: '{user} has control at the local console.',
  why_no_text: 'Type a line.',
  help: 'Help',
  help_key: 'Help (F1)',
  help_close: 'Close',
  help_keys: 'Keys',
};
