// The addresses of the files of a scene.

/** The URL of a file that the Scene names, with the token of the page. */
export function sceneUrl(relative: string): URL {
  const url = new URL(relative, document.baseURI)
  const token = new URLSearchParams(location.search).get('token')
  if (token) url.searchParams.set('token', token)
  return url
}
