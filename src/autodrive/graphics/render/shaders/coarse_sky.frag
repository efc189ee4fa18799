// The sky of a view, from an image of it with fewer pixels.
uniform sampler2D behind;
noperspective in vec2 at;
out vec4 pixel;
void main() { pixel = texture(behind, at); }
