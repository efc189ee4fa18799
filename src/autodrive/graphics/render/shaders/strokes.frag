uniform sampler2D characters;
in vec4 shade;
in vec2 place;
flat in float kind;
out vec4 pixel;
void main() {
  float far = kind == 0.0 ? length(place) : abs(place.y);
  float cover = clamp((1.0 - far) / max(fwidth(far), 1e-4), 0.0, 1.0);
  vec4 look = kind == 2.0 ? texture(characters, place, -0.8) : vec4(vec3(1.0), cover);  // letters are white, their outlines black
  pixel = shade * look;
  if (pixel.a < 0.01) discard;
}
