/** Elements that need the keys themselves: keys neither drive nor edit while one has the focus. */
export const FIELDS = 'input, select, textarea, dialog[open], [contenteditable]'
