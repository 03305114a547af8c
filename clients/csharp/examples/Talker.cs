using System;
using System.Threading;
using Nep;

/// <summary>Publishes a counter ten times a second until Enter is pressed.</summary>
internal static class Talker
{
    private static void Main()
    {
        using (var node = new Node("csharp_talker"))
        using (Publisher publisher = node.CreatePublisher("counter"))
        using (new Timer(Tick, publisher, 0, 100))
        {
            Console.WriteLine("Press Enter to end.");
            Console.ReadLine();
        }
    }

    private static void Tick(object publisher)
    {
        ((Publisher)publisher).Publish(new { time = DateTime.UtcNow, ticks = Environment.TickCount });
    }
}
