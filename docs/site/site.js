// A page that was opened as a file may not read others, so it cannot show where in them a word stands.
if (location.protocol === "file:") DOCUMENTATION_OPTIONS.SHOW_SEARCH_SUMMARY = false;
