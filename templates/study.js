// The wipe: two pictures of a scene over each other, a slider between them. Without script the pictures stand below.
for (const wipe of document.querySelectorAll(".wipe")) {
  const scene = wipe.closest("section");
  const pictures = [...scene.querySelectorAll(".pictures img")];
  const [left, right] = [wipe.querySelector(".left"), wipe.querySelector(".right")];
  const [over, under] = [wipe.querySelector(".over"), wipe.querySelector(".under")];
  const [stage, edge] = [wipe.querySelector(".stage"), wipe.querySelector(".edge")];
  const slider = wipe.querySelector("input");

  for (const select of [left, right]) {
    for (const picture of pictures) {
      select.add(new Option(picture.dataset.label, picture.id));
    }
  }
  left.value = wipe.dataset.left;
  right.value = wipe.dataset.right;

  const show = (image, select) => {
    const picture = document.getElementById(select.value);
    image.src = picture.src;
    image.alt = picture.alt;
  };
  const move = () => {
    const share = slider.value;
    over.style.clipPath = `inset(0 ${100 - share}% 0 0)`;
    edge.style.left = `${share}%`;
    slider.setAttribute("aria-valuetext", `${share} % of the left image: ${left.selectedOptions[0].text}`);
  };
  const update = () => {
    show(over, left);
    show(under, right);
    move();
  };
  const drag = (event) => {
    if (event.type === "pointerdown" || event.buttons) {
      const box = stage.getBoundingClientRect();
      slider.value = Math.round((100 * (event.clientX - box.left)) / box.width);
      move();
    }
  };
  left.addEventListener("change", update);
  right.addEventListener("change", update);
  slider.addEventListener("input", move);
  stage.addEventListener("pointerdown", drag);
  stage.addEventListener("pointermove", drag);
  over.draggable = false;
  under.draggable = false;
  update();
  wipe.hidden = false;
}
