// Names of parts of a map and kinds of signs in words.

/** 'curved_road_2' as 'Curved road 2'. */
export function words(name: string): string {
  const text = name.replaceAll('_', ' ')
  return text.charAt(0).toUpperCase() + text.slice(1)
}
