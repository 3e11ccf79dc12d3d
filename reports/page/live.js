// In a dashboard: says when there is more to see, and shows it when asked; what somebody is looking at never moves by itself.
{
  // The stamp is of what the page was made from: the first news may be of what came since.
  const {events, run, stamp} = document.body.dataset, place = document.querySelector(".live");
  if (events && place) {
    const source = new EventSource(events);
    source.addEventListener("message", event => {
      const runs = JSON.parse(event.data).runs, now = run === undefined ? JSON.stringify(runs) : runs[Number(run)];
      if (now === stamp) return;
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = "There is more: show it";
      button.addEventListener("click", () => location.reload());
      place.replaceChildren(button);
    });
  }
}
