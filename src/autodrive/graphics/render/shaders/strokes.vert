// Places the quad of a point, a line or a character. The page draws with the same source; it declares what is in PLAIN.
#ifdef PLAIN
in vec3 position;
uniform mat4 modelViewMatrix, viewMatrix, projectionMatrix;
#endif
in vec3 begin;
in vec3 end;  // y of a character: how far it is moved up in the image [heights]
in vec4 tint;
in vec4 shape;  // kind: 0 point, 1 line, 2 character; size [m]; place in the text; number of the character
uniform vec2 image;  // [pixels]
uniform float least;  // of the height of a character [pixels]
out vec4 shade;
out vec2 place;
flat out float kind;
void main() {
  shade = tint;
  kind = shape.x;
  place = position.xy;
  vec3 a = (modelViewMatrix * vec4(begin, 1.0)).xyz;
  vec3 b = (modelViewMatrix * vec4(end, 1.0)).xyz;
  float near = -0.01;
  if (kind == 1.0) {
    // the part in front of the camera
    if (a.z > near && b.z <= near) a = mix(b, a, (near - b.z) / (a.z - b.z));
    if (b.z > near && a.z <= near) b = mix(a, b, (near - a.z) / (b.z - a.z));
  }
  vec3 seen = kind == 1.0 && position.x > 0.0 ? b : a;
  float pixel = 2.0 * max(-seen.z, 0.01) / (abs(projectionMatrix[1][1]) * image.y);
  float half_size = 0.5 * max(shape.y, pixel * (kind == 2.0 ? least : 2.0));
  vec2 offset = half_size * position.xy;
  if (kind == 1.0) {
    vec2 along = b.xy / max(-b.z, 0.01) - a.xy / max(-a.z, 0.01);
    along = dot(along, along) > 0.0 ? normalize(along) : vec2(1.0, 0.0);
    offset = half_size * (position.x * along + position.y * vec2(-along.y, along.x));
  } else if (kind == 2.0) {
    offset = half_size * vec2(0.5 * position.x + shape.z, position.y + 2.0 * end.y);
    // an image of 32 columns and 16 rows
    place = vec2(mod(shape.w, 32.0), floor(shape.w / 32.0));
    place = (place + vec2(0.5 + 0.5 * position.x, 0.5 - 0.5 * position.y)) / vec2(32.0, 16.0);
  }
  gl_Position = projectionMatrix * vec4(seen.xy + offset, seen.z, 1.0);
  // in front of the ground that it lies on, also for a camera just above it
  vec3 ray = normalize((vec4(seen, 0.0) * viewMatrix).xyz);
  float lift = half_size / max(abs(ray.z), kind == 2.0 ? 0.5 : 0.1) + 0.004;  // a text stands
  vec4 lifted = projectionMatrix * vec4(seen * max(1.0 - lift / length(seen), 0.1), 1.0);
  gl_Position.z = max(lifted.z / lifted.w, -1.0) * gl_Position.w;
  if (seen.z > 0.5 * near) gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
}
