// In a dashboard: says when there is more to see, and shows it when asked; what somebody is looking at never moves by itself.
{
  const events = document.body.dataset.events, place = document.querySelector(".live");
  if (events && place) {
    const own = document.body.dataset.run, source = new EventSource(events);
    let seen = null;
    source.addEventListener("message", event => {
      const runs = JSON.parse(event.data).runs, now = JSON.stringify(own === undefined ? runs : runs[Number(own)]);
      if (seen === null || seen === now) { seen ??= now; return; }
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = "There is more: show it";
      button.addEventListener("click", () => location.reload());
      place.replaceChildren(button);
    });
  }
}
